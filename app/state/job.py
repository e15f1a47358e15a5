"""Job: work that is wanted of the worker, and the files that it makes for tabs of the page.

A tab requests a map or a trajectory as a file; a job makes it, and the tab downloads it.
"""

from collections.abc import Hashable
from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from nerfnav.export import Refusal, Subject
from nerfnav_app.places.ends import Ends
from nerfnav_app.state.plan import PlanRecord
from nerfnav_app.state.tracks import StartTrack


@dataclass(frozen=True)
class MapDownload:
    """Request a map of the place as a file."""

    ending: str
    """Suffix of the file, which sets the kind of map: a key of `nerfnav.export.occupancy_map.ENDINGS`."""
    client: int
    """The tab that requests it."""


@dataclass(frozen=True)
class TrajectoryDownload:
    """Request a trajectory for a vehicle as a file; it is checked for safety first."""

    format: str
    """Name of the format."""
    client: int
    """The tab that requests it."""
    subject: Subject = Subject.PLAN
    """Trajectory to export."""
    force: bool = False
    """Make it also where it is not safe."""
    smooth: bool = False
    """Make a smooth curve of an executed path or an estimate."""


DownloadRequest = MapDownload | TrajectoryDownload
"""A file that is made for one tab."""


@dataclass(frozen=True)
class Download:
    """A file for one tab."""

    id: int
    """Id of the job that made it: it is sent once."""
    client: int
    """The tab that requested it."""
    name: str
    content: bytes = field(repr=False)


@dataclass(frozen=True)
class RefusedExport:
    """Trajectory that the worker refused to export."""

    refusal: Refusal
    """Subject, format, reason and remedies."""
    cause: Hashable = None
    """`Session.asked` at that time: once that has changed, the refusal is out of date."""


class JobKind(Enum):
    """Kinds of work; the names are stored, the values too."""

    OPEN = "open"
    PLAN = "plan"
    FLY = "fly"
    COMPARE = "compare"
    EXPERIMENT = "do the experiment"
    FIND = "find the robot"
    MAP = "make the map"
    EXPORT = "export"
    PLACE = "put the place right"
    TRACK = "track the camera"

    @property
    def verb(self) -> str:
        """Name the work for the user, as in "Could not plan"."""
        plain = {JobKind.EXPERIMENT: "run the experiment", JobKind.PLACE: "align the place"}
        return plain.get(self, self.value)


@dataclass(frozen=True)
class Job:
    """Work of the worker, until the session wants other work or none."""

    id: int
    """Unique in a session: separates late reports of a cancelled job from those of the next."""
    kind: JobKind
    ends: Ends = field(default_factory=Ends)
    """Start and goal."""
    first_plan: PlanRecord | None = None
    """For a flight: a finished plan between these ends to begin with."""
    anyway: bool = False
    """For a flight: fly although its plan is unsafe."""
    plan_after: bool = False
    """For a place that is being opened: plan as soon as it can be seen."""
    fly_after: bool = False
    """For a plan: fly it afterwards, if it is safe."""
    label: str = ""
    """Description of the work in progress, for the user."""
    fraction: float | None = None
    """0 to 1; None while unknown."""
    left_s: float | None = None
    """Estimated time left [s]; None while unknown."""
    picture: np.ndarray | None = field(default=None, compare=False, repr=False)
    """Picture of the field in training, (height, width, 3), sRGB bytes; None while there is none."""
    paused: bool = False
    """Hold once the flight has reported `allowed_steps` time steps."""
    allowed_steps: int = 0
    """Time steps that a paused flight may take in all."""
    pace: float = 0.0
    """Speed of a flight as a multiple of real time; 0: as fast as it is computed."""
    gusts: int = 0
    """Gusts that were requested so far."""
    kidnaps: int = 0
    """Kidnaps that were requested so far."""
    searches: int = 0
    """Global localizations that were requested so far."""
    request: DownloadRequest | None = None
    """The file to make."""
    track: StartTrack | None = None
    """The camera to track."""

    @property
    def runs_unpaced(self) -> bool:
        """True for a flight that runs as fast as it is computed: faster than the page can show each step."""
        return self.kind is JobKind.FLY and not self.paused and self.pace <= 0
