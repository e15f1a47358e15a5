"""Actions that the session reacts to: commands of the user, reports of jobs, results of queries, the time."""

from dataclasses import dataclass
from enum import Enum
from typing import Any, Protocol

from nerfnav_app.jobs.events import JobReport
from nerfnav_app.places.ends import End, EndRole
from nerfnav_app.places.sources import QualityName
from nerfnav_app.state.alignment import AlignmentAction
from nerfnav_app.state.experiments import ExperimentAction
from nerfnav_app.state.job import DownloadAction
from nerfnav_app.state.records import PlanAction
from nerfnav_app.state.robot_draft import EditRobot, ForgetEdits
from nerfnav_app.state.runs import RunAction, RunChange
from nerfnav_app.state.session import Session, Vector
from nerfnav_app.state.settings import Choice
from nerfnav_app.state.tracks import TrackAction
from nerfnav_app.state.view import TabAction


@dataclass(frozen=True)
class MoveEnd:
    """Put the start or the goal somewhere else."""

    which: EndRole
    end: End
    held: bool = False
    """Whether a hand still moves it."""


@dataclass(frozen=True)
class TypeEnd:
    """Put the start or the goal where its numbers say; unlike a hand, they may say a place that is none."""

    which: EndRole
    end: End


@dataclass(frozen=True)
class ChooseTask:
    """Take start and goal of a task of the scene."""

    name: str


@dataclass(frozen=True)
class OpenPlace:
    """Open another scene or field."""

    what: str
    """Name of a bundled scene, or path of a field file."""


@dataclass(frozen=True)
class ChooseQuality:
    """Learn places that come without a field so well from now on."""

    quality: QualityName


@dataclass(frozen=True)
class ListPlaces:
    """List the library of places again: one was renamed or deleted."""


@dataclass(frozen=True)
class Choose:
    """Take another robot, planner or estimator."""

    choice: Choice


@dataclass(frozen=True)
class Aim:
    """Let the next click into the scene put an end there; None: let clicks be clicks."""

    which: EndRole | None


@dataclass(frozen=True)
class Point:
    """A click into the scene."""

    origin: Vector
    """Where the ray of the click begins [m]."""
    direction: Vector
    """Where it goes, of any length."""


class Settings(Enum):
    """Records whose numbers a person may change."""

    VIEW = "view_settings"
    PLAN = "plan_settings"
    WEIGHTS = "weights"
    FLIGHT = "flight_settings"


@dataclass(frozen=True)
class Adjust:
    """Change one number of the settings; the others may be changed elsewhere at the same time."""

    settings: Settings
    name: str
    """Name of the record's field."""
    value: Any


@dataclass(frozen=True)
class StartComparison:
    """Let every planner find its way between the ends."""


@dataclass(frozen=True)
class Gust:
    """Push the flying robot, once."""


@dataclass(frozen=True)
class KidnapRobot:
    """Put the flying robot down somewhere else, once."""


@dataclass(frozen=True)
class FindRobot:
    """Look for the robot everywhere, by its last picture alone; a flight goes on from where it is found."""


@dataclass(frozen=True)
class StartPlan:
    """Optimise a trajectory between the ends."""


@dataclass(frozen=True)
class StartFlight:
    """Fly from start to goal with the camera alone, replanning at every step."""

    anyway: bool = False
    """Whether to fly a plan that is not safe: else the person is asked first."""


@dataclass(frozen=True)
class Cancel:
    """Stop the running job and keep what it has shown."""


@dataclass(frozen=True)
class Pause:
    """Hold the running job after the time step in progress."""


@dataclass(frozen=True)
class Resume:
    """Let a held job go on."""


@dataclass(frozen=True)
class StepOnce:
    """Let a held job take one time step."""


@dataclass(frozen=True)
class Reset:
    """Stop, forget plan and flight, put the ends back where the task has them, and all settings as they were."""


@dataclass(frozen=True)
class Undo:
    """Go back to before the last move or setting."""


@dataclass(frozen=True)
class Redo:
    """Take the last undo back."""


@dataclass(frozen=True)
class Tell:
    """Notify the user."""

    title: str
    body: str
    bad: bool = False


Command = (
    MoveEnd
    | TypeEnd
    | ChooseTask
    | OpenPlace
    | ChooseQuality
    | ListPlaces
    | Choose
    | Aim
    | Point
    | Adjust
    | TabAction
    | StartComparison
    | Gust
    | KidnapRobot
    | FindRobot
    | StartPlan
    | StartFlight
    | PlanAction
    | DownloadAction
    | Cancel
    | Pause
    | Resume
    | StepOnce
    | Reset
    | EditRobot
    | ForgetEdits
    | Undo
    | Redo
    | RunAction
    | AlignmentAction
    | TrackAction
    | ExperimentAction
    | Tell
)


@dataclass(frozen=True)
class Reported:
    """A job has yielded something or ended."""

    job: int
    """Which job, `Job.id`."""
    event: JobReport


class AppliesResult(Protocol):
    """A query, as far as the session has to know: nerfnav_app.queries.query.Query."""

    def apply(self, session: Session, result: Any) -> Session:
        """The session with the result of the query."""
        ...


@dataclass(frozen=True)
class QueryAnswered:
    """The worker has answered a query."""

    query: AppliesResult
    result: Any


@dataclass(frozen=True)
class RunChanged:
    """The worker has renamed or deleted a stored run."""

    change: RunChange
    problem: str | None = None
    """One sentence, or None where all is well."""


@dataclass(frozen=True)
class Tick:
    """Some time has passed."""

    seconds: float


Action = Command | Reported | QueryAnswered | RunChanged | Tick
