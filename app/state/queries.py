"""What the page would like to know of the place, and the worker's answers."""

from dataclasses import dataclass, field
from enum import Enum
from typing import Any

import numpy as np

from app.choice import Choice
from app.places.ends import End, Ends, Which
from app.state.experiments import TrialsQuestion, TrialsReport
from app.state.run_queries import RunsQuestion, RunsReport
from app.state.view_settings import Eye
from nerfnav.planner.steps import PlanStep
from nerfnav.robots.state import Motion, RigidState

Vector = tuple[float, float, float]


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
    offer: End | None = None
    """The nearest end at which the robot fits, where it does not fit here."""


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
class PointQuestion:
    """Where does a click land?"""

    which: Which
    """The end that is put there."""
    origin: Vector
    """Where the ray of the click begins [m]."""
    direction: Vector
    """Where it goes, of any length."""


@dataclass(frozen=True)
class Landed:
    """Where a click has landed."""

    question: PointQuestion
    position: Vector | None
    """Where the end goes [m]; None where the ray meets nothing."""


@dataclass(frozen=True)
class ProfileQuestion:
    """How near does a plan come to what is dense?"""

    number: int
    """Which plan: two questions of one number have the same answer."""
    motion: Motion = field(compare=False)


@dataclass(frozen=True)
class Profile:
    """How near a plan comes to what is dense, step by step."""

    question: ProfileQuestion
    rows: np.ndarray = field(compare=False)
    """Time [s], clearance [cm] and bound on the probability of a collision [%] of each step, (3, n)."""


@dataclass(frozen=True)
class EyeQuestion:
    """What does the field look like from a tab's own camera?"""

    client: int
    eye: Eye
    width: int
    """Of the picture [pixels]."""


@dataclass(frozen=True)
class EyeView:
    """The field from a tab's own camera."""

    question: EyeQuestion
    image: np.ndarray = field(compare=False)
    """(height, width, 3), sRGB bytes."""
    depth: np.ndarray = field(compare=False)
    """Distance along the camera's axis [m], (height, width)."""


class Space(Enum):
    """Parts of space that can be shown."""

    OCCUPIED = "where the robot does not fit"
    UNKNOWN = "what no camera saw"


@dataclass(frozen=True)
class SpaceQuestion:
    """Where is such space?"""

    space: Space


@dataclass(frozen=True)
class SpaceView:
    """The outside of a part of space."""

    question: SpaceQuestion
    centers: np.ndarray = field(compare=False)
    """Centres of voxels (n, 3) [m]."""
    spacing: float = field(compare=False)
    """Their edge [m]."""


@dataclass(frozen=True)
class SliceQuestion:
    """How dense is the field at one height?"""

    share: float
    """Of the height of the box, 0 to 1."""


@dataclass(frozen=True)
class SliceView:
    """A level slice through the density, seen from above."""

    question: SliceQuestion
    image: np.ndarray = field(compare=False)
    """(along x, along y, 4), sRGB bytes and opacity."""


@dataclass(frozen=True)
class View:
    """The field as a robot's camera would see it."""

    question: ViewQuestion
    images: tuple[np.ndarray, ...] = field(compare=False)
    """One for each state, (height, width, 3), sRGB bytes."""


Question = (
    EndQuestion
    | ViewQuestion
    | PlanQuestion
    | PointQuestion
    | ProfileQuestion
    | EyeQuestion
    | SpaceQuestion
    | SliceQuestion
    | RunsQuestion
    | TrialsQuestion
)
Answer = EndReport | View | Replanned | Landed | Profile | EyeView | SpaceView | SliceView | RunsReport | TrialsReport
