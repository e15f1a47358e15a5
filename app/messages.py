"""What the session reacts to: commands of the user, questions that the page raises and the worker answers."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from app.choice import Choice
from app.ends import End, Ends, Which
from app.events import JobEvent
from app.flying import FlightSettings
from app.place import Place
from nerfnav.planner.steps import PlanStep
from nerfnav.robots.state import RigidState


@dataclass(frozen=True)
class MoveEnd:
    """Put the start or the goal somewhere else."""

    which: Which
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
class Choose:
    """Take another robot, planner or estimator."""

    choice: Choice


@dataclass(frozen=True)
class SetFlight:
    """Fly otherwise: the noise and the seed from the next flight on, the speed at once."""

    settings: FlightSettings


@dataclass(frozen=True)
class Gust:
    """Push the flying robot, once."""


@dataclass(frozen=True)
class StartPlan:
    """Optimise a trajectory between the ends."""


@dataclass(frozen=True)
class StartFlight:
    """Fly from start to goal with the camera alone, replanning at every step."""


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
    """Stop, forget plan and flight, and put the ends back where the task has them."""


@dataclass(frozen=True)
class Tell:
    """Notify the user."""

    title: str
    body: str
    bad: bool = False


Command = (
    MoveEnd
    | ChooseTask
    | OpenPlace
    | Choose
    | SetFlight
    | Gust
    | StartPlan
    | StartFlight
    | Cancel
    | Pause
    | Resume
    | StepOnce
    | Reset
    | Tell
)


@dataclass(frozen=True)
class PlaceOpened:
    """The field is loaded: the ends can be moved and plans be made."""

    place: Place


@dataclass(frozen=True)
class SurfaceShaped:
    """The field can be seen."""

    glb: bytes
    """Binary glTF, unlit, world axes."""


@dataclass(frozen=True)
class Reported:
    """A job has yielded something."""

    job: int
    """Which job, `Job.id`."""
    event: JobEvent | PlaceOpened | SurfaceShaped


@dataclass(frozen=True)
class EndQuestion:
    """Does the robot fit here?"""

    which: Which
    end: End


@dataclass(frozen=True)
class EndReport:
    """Whether the robot fits at an end."""

    question: EndQuestion
    problem: str | None
    """One sentence, or None where all is well."""


@dataclass(frozen=True)
class ViewQuestion:
    """What does the field look like to a robot's camera?"""

    key: tuple[Any, ...]
    """What the view is of; two questions of one key have the same answer."""
    states: tuple[RigidState, ...] = field(compare=False)
    """From where it looks."""


@dataclass(frozen=True)
class PlanQuestion:
    """What is the plan between these ends now?"""

    ends: Ends
    choice: Choice


@dataclass(frozen=True)
class Replanned:
    """A plan that followed the hand."""

    question: PlanQuestion
    steps: tuple[PlanStep, ...] = field(compare=False)
    """Its iterations; empty where there is no plan."""
    summary: dict[str, Any] = field(compare=False)
    """The job's numbers."""


@dataclass(frozen=True)
class Tick:
    """Some time has passed."""

    seconds: float


@dataclass(frozen=True)
class View:
    """The field as a robot's camera would see it."""

    question: ViewQuestion
    images: tuple[np.ndarray, ...] = field(compare=False)
    """One for each state, (height, width, 3), sRGB bytes."""


Question = EndQuestion | ViewQuestion | PlanQuestion
Answer = EndReport | View | Replanned
Message = Command | Reported | Answer | Tick
