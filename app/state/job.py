"""Job: work that is wanted of the worker, and the files that it makes for tabs of the page.

A tab wishes for a map or a trajectory as a file; a job makes it, and the tab that asked gets the download.
"""


from dataclasses import dataclass, field
from enum import Enum

from nerfnav_app.places.ends import Ends
from nerfnav_app.state.records import PlanRecord
from nerfnav_app.state.tracks import StartTrack


@dataclass(frozen=True)
class MapDownload:
    """A map of the place that somebody wants to take away."""

    ending: str
    """Of the file, which says what kind of map: a key of `nerfnav.export.occupancy_map.ENDINGS`."""
    client: int
    """The tab that asks."""


@dataclass(frozen=True)
class TrajectoryDownload:
    """What a vehicle is to fly, as a file that somebody wants to take away."""

    format: str
    """Name of the format."""
    client: int
    """The tab that asks."""
    force: bool = False
    """Whether to have it also where it should not be flown."""


DownloadRequest = MapDownload | TrajectoryDownload
"""What is made for one tab."""


@dataclass(frozen=True)
class Download:
    """A file for one tab."""

    id: int
    """That of the job which made it: it is sent once."""
    client: int
    """The tab that asked."""
    name: str
    content: bytes = field(repr=False)


@dataclass(frozen=True)
class TakeMap:
    """Make a map of the place and send it to the tab that asks."""

    wish: MapDownload


@dataclass(frozen=True)
class TakeTrajectory:
    """Make the file for a vehicle, once it is judged, and send it to the tab that asks."""

    wish: TrajectoryDownload


DownloadAction = TakeMap | TakeTrajectory


class JobKind(Enum):
    """What the worker can be asked for; the value is a verb for the user."""

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


@dataclass(frozen=True)
class Job:
    """Work that is wanted of the worker, until the session wants other work or none."""

    id: int
    """Unique in a session: tells late reports of a cancelled job from those of the next."""
    kind: JobKind
    """What to do."""
    ends: Ends = field(default_factory=Ends)
    """Between which start and goal."""
    first_plan: PlanRecord | None = None
    """For a flight: a finished plan between these ends, to begin with."""
    anyway: bool = False
    """For a flight: whether it is wanted though its plan is not safe."""
    plan_after: bool = False
    """For a place that is being opened: whether the way is to be planned as soon as that can be."""
    fly_after: bool = False
    """For a plan: whether it is to be flown, if it is good."""
    label: str = ""
    """What is being done, for the user."""
    fraction: float | None = None
    """0 to 1; None while unknown."""
    left_s: float | None = None
    """About how long it will still take [s]; None while unknown."""
    paused: bool = False
    """Whether to hold once the flight has reported `allowed_steps` time steps."""
    allowed_steps: int = 0
    """How far a paused flight may go; it holds at once where it has gone that far."""
    pace: float = 0.0
    """How many times faster than in reality a flight may go; 0 is as fast as it is computed."""
    gusts: int = 0
    """How many gusts a flight was asked to endure so far."""
    kidnaps: int = 0
    """How many times its robot was to be carried away."""
    searches: int = 0
    """How many times it was asked to look for the robot everywhere."""
    wish: DownloadRequest | None = None
    """The file that is to be made."""
    track: StartTrack | None = None
    """What is to be tracked."""

    @property
    def runs_unpaced(self) -> bool:
        """Whether it is a flight that goes on as fast as it is computed: its next step waits for nobody, and nobody can
        follow all that it tells."""
        return self.kind is JobKind.FLY and not self.paused and self.pace <= 0
