"""Actions that the session reacts to: commands of the user, reports of jobs, results of queries, the time."""

from dataclasses import dataclass
from enum import Enum
from typing import Any, Protocol

from nerfnav_app.jobs.events import JobReport
from nerfnav_app.state.alignment import AlignmentAction
from nerfnav_app.state.flight import FindRobot, Gust, KidnapRobot, Pause, Resume, StartFlight, StepOnce
from nerfnav_app.state.job import DownloadRequest
from nerfnav_app.state.obstacles import ObstacleAction
from nerfnav_app.state.place import (
    AimEnd,
    Choose,
    ChooseQuality,
    ChooseTask,
    ClickScene,
    ListPlaces,
    MoveEnd,
    OpenPlace,
    TypeEnd,
)
from nerfnav_app.state.plan import PlanAction, StartComparison, StartPlan
from nerfnav_app.state.robot_draft import DiscardEdits, EditRobot
from nerfnav_app.state.runs import ExperimentAction, RunAction, RunChange
from nerfnav_app.state.session import Session
from nerfnav_app.state.tracks import TrackAction
from nerfnav_app.state.view import TabAction


class Settings(Enum):
    """Records of settings whose numbers the user may change; the values are fields of the session."""

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
class Cancel:
    """Stop the running job and keep what it has shown."""


@dataclass(frozen=True)
class Reset:
    """Stop, discard plan and flight, and restore the task's ends and all default settings."""


@dataclass(frozen=True)
class Undo:
    """Return to the settings before the last move or change."""


@dataclass(frozen=True)
class Redo:
    """Revert the last undo."""


@dataclass(frozen=True)
class Notify:
    """Show the user a message."""

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
    | AimEnd
    | ClickScene
    | ObstacleAction
    | StartPlan
    | StartComparison
    | PlanAction
    | StartFlight
    | Pause
    | Resume
    | StepOnce
    | Gust
    | KidnapRobot
    | FindRobot
    | TabAction
    | AlignmentAction
    | TrackAction
    | RunAction
    | ExperimentAction
    | DownloadRequest
    | EditRobot
    | DiscardEdits
    | Adjust
    | Cancel
    | Reset
    | Undo
    | Redo
    | Notify
)


@dataclass(frozen=True)
class Reported:
    """A job has yielded something or ended."""

    job: int
    """Its id, `Job.id`."""
    event: JobReport


class AppliesResult(Protocol):
    """A query, as far as the session needs it: nerfnav_app.queries.query.Query."""

    def apply(self, session: Session, result: Any) -> Session:
        """Return the session with the result of the query."""
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
    """One sentence, or None where it succeeded."""


@dataclass(frozen=True)
class Tick:
    """Some time has passed."""

    seconds: float


Action = Command | Reported | QueryAnswered | RunChanged | Tick
