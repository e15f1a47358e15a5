"""Events of jobs for their consumers (command line, browser): frozen values, in the order in which they happen.

A job is a generator: it yields events and returns a JobResult, so a job inside another one is `yield from`. Library
steps (PlanStep, FilterStep, NavigationStep, TrainStep) are events as they are; all other events are defined here.
The consumer that runs a job, the worker, adds the event of its end (JobFinished, JobFailed).
"""

from collections.abc import Generator, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from jaxtyping import UInt8
from torch import Tensor

from nerfnav.field import TrainStep
from nerfnav.navigation import FlightStep
from nerfnav.robots import Motion
from nerfnav.tracking import TrackedFrame
from nerfnav_app.places.place import Place

COMPILING = "compiling kernels, once on this machine"
"""What a job does while it waits for the compiler, whatever else it is about."""


@dataclass(frozen=True)
class Progress:
    """How far a job is."""

    label: str
    """What is being done, e.g. "optimising"."""
    fraction: float
    """0 to 1."""


@dataclass(frozen=True)
class JobResult:
    """Return value of a job."""

    summary: dict[str, Any] = field(default_factory=dict)
    """Its numbers: what `--json` prints."""
    files: tuple[Path, ...] = ()
    """What it wrote."""


@dataclass(frozen=True)
class JobFinished:
    """A job has done what was asked."""

    name: str
    """What it is called, e.g. "plan"."""
    result: JobResult = field(default_factory=JobResult)


@dataclass(frozen=True)
class JobFailed:
    """A job has ended without doing what was asked."""

    name: str
    """What it is called."""
    message: str
    """One sentence for the user."""


@dataclass(frozen=True)
class PlaceOpened:
    """The field is loaded: the ends can be moved and plans be made."""

    place: Place


@dataclass(frozen=True)
class SurfaceShaped:
    """The field can be seen."""

    glb: bytes
    """Binary glTF, unlit, world axes; empty where nothing is dense enough to be seen."""
    rough: bool = False
    """Whether it has colours at its corners, and no texture yet."""


@dataclass(frozen=True)
class FileMade:
    """There is a file to take away."""

    name: str
    """What to call it."""
    content: bytes = field(repr=False)


@dataclass(frozen=True)
class PlannerResult:
    """What one planner has found, to be held against the others."""

    planner: str
    """Its name."""
    motion: Motion | None
    """Its plan; None where it refused."""
    summary: dict[str, Any]
    """The job's numbers."""
    complaint: str = ""
    """Why it refused."""


@dataclass(frozen=True)
class PlannerCompared:
    """One planner of a comparison has ended."""

    result: PlannerResult


@dataclass(frozen=True)
class FrameTracked:
    """A picture of a camera that is followed was looked at."""

    tracked: TrackedFrame
    """Where the camera was."""
    seen: UInt8[Tensor, "height width 3"] | None = field(default=None, repr=False)
    """The picture, as it was compared; None where nobody wants to see it."""
    shown: UInt8[Tensor, "height width 3"] | None = field(default=None, repr=False)
    """What the field shows from there; None likewise, and where nobody knows where that is."""


JobEvent = FlightStep | TrainStep | Progress | PlaceOpened | SurfaceShaped | PlannerCompared | FileMade | FrameTracked

JobReport = JobEvent | JobFinished | JobFailed
"""What is told of a job that runs: what it yields, then how it ended."""

JobEvents = Generator[JobEvent, bool | None, JobResult]
"""A job at work. Closing it cancels it; a job that says so takes True and ends early with what it has."""


class JobRun:
    """Iterator over the events of a job, once, that keeps its return value."""

    result: JobResult
    """What the job returned; not there before it has ended."""

    def __init__(self, job: JobEvents) -> None:
        """Nothing of the job is done yet."""
        self._job = job

    def __iter__(self) -> Iterator[JobEvent]:
        """Yield what the job yields. Raises what it raises."""
        self.result = yield from self._job
