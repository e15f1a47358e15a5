"""Stored results: runs with the timeline of the shown flight or track, and experiments, with the commands on them."""

from bisect import bisect_right
from dataclasses import dataclass, field, replace
from typing import TypeVar, cast

from nerfnav_app.state.flight import FlightRecord
from nerfnav_app.state.obstacles import PlacedObstacle
from nerfnav_app.state.tracks import TrackRecord
from nerfnav_app.storage.run_metadata import StoredRun

MOST_TRIALS = 100
"""Limit of the page; the command line has none."""


@dataclass(frozen=True)
class ListRuns:
    """List the stored runs again: other programs fly too."""


@dataclass(frozen=True)
class OpenRun:
    """Show a stored run in its place."""

    name: str


@dataclass(frozen=True)
class CompareRun:
    """Show a second flight beside the first; None ends the comparison."""

    name: str | None


@dataclass(frozen=True)
class RenameRun:
    """Rename a stored run."""

    name: str
    to: str


@dataclass(frozen=True)
class DeleteRun:
    """Delete a stored run for good."""

    name: str


@dataclass(frozen=True)
class Scrub:
    """Show the flight at a time step."""

    at: float
    """As a browser sends it: any number."""


@dataclass(frozen=True)
class PlayBack:
    """Start or stop the timeline."""

    on: bool


RunAction = ListRuns | OpenRun | CompareRun | RenameRun | DeleteRun | Scrub | PlayBack


TimedRecord = FlightRecord | TrackRecord
"""Record that a timeline goes along: at most one of them is on the page."""
AnyTimedRecord = TypeVar("AnyTimedRecord", bound=FlightRecord | TrackRecord)


@dataclass(frozen=True)
class StoredFlight:
    """A stored run with all its steps."""

    entry: StoredRun
    record: FlightRecord
    obstacles: tuple[PlacedObstacle, ...] = ()
    """Obstacles of its place."""


@dataclass(frozen=True)
class RunRequest:
    """A stored run that the user wants to see."""

    id: int
    """Unique in a session."""
    name: str
    compare: bool = False
    """Show it beside the flight that is shown."""


@dataclass(frozen=True)
class RunChange:
    """A stored run to rename or delete, once."""

    id: int
    """Unique in a session."""
    name: str
    to: str | None = None
    """Its new name; None deletes it for good."""

    @property
    def verb(self) -> str:
        """Name the change for the user."""
        return "delete" if self.to is None else "rename"


@dataclass(frozen=True)
class Timeline:
    """Time step of a flight, or frame of a track, that the page shows."""

    flight: TimedRecord | None = None
    """The flight or track that it belongs to; it does not apply to any other."""
    part: TimedRecord | None = None
    """The same up to the time that is shown."""
    elapsed_s: float = 0.0
    """Its position while it runs [s]."""
    playing: bool = False

    @property
    def at(self) -> int:
        """The time step that is shown."""
        return len(self.part.steps) - 1 if self.part is not None else 0

    def moved(self, flight: TimedRecord, at: float) -> "Timeline":
        """Move to the time step nearest to `at`, and stop there."""
        step = min(max(round(at), 0), len(flight.steps) - 1)
        return Timeline(flight, flight.cut(step), flight.times[step])

    def started(self, flight: TimedRecord) -> "Timeline":
        """Start it; from the first step where it was at the end, or showed another flight."""
        here = self if self.flight is flight and self.at < len(flight.steps) - 1 else self.moved(flight, 0)
        return replace(here, playing=True)

    def rolled(self, seconds: float) -> "Timeline":
        """Advance it by some time [s]."""
        if not self.playing or self.flight is None:
            return self
        times, elapsed = self.flight.times, self.elapsed_s + seconds
        at = bisect_right(times, elapsed + 1e-6) - 1
        part = self.part if at == self.at else self.flight.cut(at)
        return replace(self, elapsed_s=elapsed, part=part, playing=at < len(times) - 1)


@dataclass(frozen=True)
class Runs:
    """Stored runs, and those of them that are shown."""

    entries: tuple[StoredRun, ...] = ()
    """The newest first."""
    listed: tuple[int, ...] | None = None
    """State of the session for which they were listed."""
    wanted: tuple[RunRequest, ...] = ()
    """Requested runs that are not read yet."""
    changes: tuple[RunChange, ...] = ()
    """Requested changes that are not made yet."""
    asked: int = 0
    """Number of requests and changes so far."""
    opened: StoredFlight | None = None
    """The run that was opened last; it is shown while the session's flight is its record."""
    compared: StoredFlight | None = None
    """A second run, shown beside the first."""
    timeline: Timeline = field(default_factory=Timeline)

    def wanting(self, name: str, compare: bool = False) -> "Runs":
        """Add a request for a run."""
        return replace(self, wanted=(*self.wanted, RunRequest(self.asked, name, compare)), asked=self.asked + 1)

    def changing(self, name: str, to: str | None) -> "Runs":
        """Add a change of a run."""
        return replace(self, changes=(*self.changes, RunChange(self.asked, name, to)), asked=self.asked + 1)

    def elsewhere(self) -> "Runs":
        """Close the shown runs: another place is being opened."""
        return replace(self, opened=None, compared=None, timeline=Timeline())

    def entry(self, name: str) -> StoredRun | None:
        """Find the run of that name, if there is one."""
        return next((entry for entry in self.entries if entry.name == name), None)

    def shown(self, record: AnyTimedRecord | None) -> AnyTimedRecord | None:
        """Cut a flight or track at the time that the timeline shows."""
        if record is None or self.timeline.flight is not record:
            return record
        return cast("AnyTimedRecord | None", self.timeline.part)


@dataclass(frozen=True)
class StartExperiment:
    """Run an experiment with some trials."""

    name: str
    """Name of the experiment."""
    trials: int
    """Number of trials."""


@dataclass(frozen=True)
class ShowResult:
    """Show the results of an experiment."""

    name: str
    """Of the folder."""


@dataclass(frozen=True)
class ListExperiments:
    """List experiments and their results."""


ExperimentAction = StartExperiment | ShowResult | ListExperiments


@dataclass(frozen=True)
class ExperimentState:
    """Experiments of a session."""

    asked: StartExperiment | None = None
    """The last that was started."""
    stamp: int = 0
    """Rises when there may be new results; 0 until the page asks for them."""
    show: str | None = None
    """Folder of the results that are shown."""

    def commanded(self, action: ExperimentAction) -> "ExperimentState":
        """Apply an action of the user."""
        match action:
            case StartExperiment():
                return replace(self, asked=action)
            case ShowResult(name):
                return replace(self, show=name)
            case ListExperiments():
                return replace(self, stamp=self.stamp + 1)

    def ended(self, folder: str) -> "ExperimentState":
        """Show the results of an experiment that has ended, in `folder`."""
        return replace(self, stamp=self.stamp + 1, show=folder)
