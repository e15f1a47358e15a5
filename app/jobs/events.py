"""Events of jobs for their consumers (command line, browser): frozen values, in the order in which they happen.

A job is a generator: it yields events and returns a JobResult, so a job inside another one is `yield from`. Library
steps (PlanStep, FilterStep, NavigationStep, TrainStep) are events as they are; all other events are defined here.
The consumer that runs a job, the worker, adds the event of its end (JobFinished, JobFailed).
"""

from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from jaxtyping import UInt8
from torch import Tensor

from nerfnav.export import Refusal
from nerfnav.field import TrainStep
from nerfnav.importers import Corners
from nerfnav.navigation import FlightStep
from nerfnav.robots import Motion
from nerfnav.tracking import TrackedFrame
from nerfnav_app.places.place import Place

COMPILING = "compiling kernels, once on this machine: about a minute"
"""Progress label of any job while it waits for the compiler."""


@dataclass(frozen=True)
class Progress:
    """Progress of a job."""

    label: str
    """Present work, such as "optimising"."""
    fraction: float
    """0 to 1."""
    left_s: float | None = None
    """Time to the end of the job's present part, such as a training [s]; None while unknown."""


@dataclass(frozen=True)
class Remark:
    """Event: a sentence for the user that is no result."""

    sentence: str


@dataclass(frozen=True)
class JobResult:
    """Return value of a job."""

    summary: dict[str, Any] = field(default_factory=dict)
    """Numbers that `--json` prints."""
    files: tuple[Path, ...] = ()
    """Files that it wrote."""


@dataclass(frozen=True)
class JobFinished:
    """End of a job that has done its work."""

    name: str
    """Name of the job, such as "plan"."""
    result: JobResult = field(default_factory=JobResult)


@dataclass(frozen=True)
class JobFailed:
    """End of a job that has failed."""

    name: str
    """Name of the job."""
    message: str
    """One sentence for the user."""
    without: Corners | None = None
    """Box that leaves out the parts of a mesh that the user has to decide on; None where there are none."""


@dataclass(frozen=True)
class PlaceOpened:
    """Event: the field is loaded, start and goal can be moved, and plans be made."""

    place: Place


@dataclass(frozen=True)
class SurfaceShaped:
    """Event: the field can be seen."""

    glb: bytes
    """Binary glTF, unlit, world axes; empty where nothing is dense enough to be seen."""
    rough: bool = False
    """Colours at its corners only, no texture yet."""


@dataclass(frozen=True)
class FileMade:
    """Event: there is a file to download."""

    name: str
    """Name of the file."""
    content: bytes = field(repr=False)


@dataclass(frozen=True)
class TrajectoryRefused:
    """Event: a trajectory is not exported, for it is not safe to fly."""

    refusal: Refusal
    """Subject, reason and remedies."""


@dataclass(frozen=True)
class PlannerResult:
    """Result of one planner, to compare with the others."""

    planner: str
    """Name of the planner."""
    motion: Motion | None
    """Its plan; None where it refused."""
    summary: dict[str, Any]
    """The job's numbers."""
    complaint: str = ""
    """Why it refused."""


@dataclass(frozen=True)
class PlannerCompared:
    """Event: one planner of a comparison has ended."""

    result: PlannerResult


@dataclass(frozen=True)
class FrameTracked:
    """Event: a frame of a tracked camera was processed."""

    tracked: TrackedFrame
    """Estimate of the tracker."""
    seen: UInt8[Tensor, "height width 3"] | None = field(default=None, repr=False)
    """The picture as it was compared; None where pictures are not asked for."""
    shown: UInt8[Tensor, "height width 3"] | None = field(default=None, repr=False)
    """Rendering of the field from the estimated pose; None likewise, and where the pose is unknown."""


JobEvent = (
    FlightStep | TrainStep | Progress | Remark | PlaceOpened | SurfaceShaped | PlannerCompared | FileMade
    | TrajectoryRefused | FrameTracked
)  # fmt: skip

JobReport = JobEvent | JobFinished | JobFailed
"""Event of a running job for its consumer: what it yields, then its end."""

JobEvents = Generator[JobEvent, bool | None, JobResult]
"""Generator of a job. Closing it cancels it; some jobs take True, and end early with what they have."""


Step = TypeVar("Step")
Result = TypeVar("Result")


def relay_steps(
    steps: Generator[Step, Any, Result], events_of: Callable[[Step], Sequence[Any]]
) -> Generator[Any, Any, Result]:
    """Yield the events of each step, and return what the steps return; the answer to the last event is passed on."""
    answer: Any = None
    while True:
        try:
            step = steps.send(answer)
        except StopIteration as end:
            return end.value
        for event in events_of(step):
            answer = yield event


class JobRun:
    """Iterator over the events of a job, once, that keeps its return value."""

    result: JobResult
    """Return value of the job; missing before it has ended."""

    def __init__(self, job: JobEvents) -> None:
        """Keep the job, which has not begun."""
        self._job = job

    def __iter__(self) -> Iterator[JobEvent]:
        """Yield what the job yields. Raises what it raises."""
        self.result = yield from self._job
