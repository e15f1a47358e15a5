"""Stored runs in the session, and the timeline: the time at which the shown flight or track is looked at.

The actions are those of a person on stored runs and on the timeline.
"""


from bisect import bisect_right
from dataclasses import dataclass, field, replace
from typing import TypeVar, cast

from nerfnav_app.state.records import FlightRecord
from nerfnav_app.state.tracks import TrackRecord
from nerfnav_app.storage.run_metadata import StoredRun


@dataclass(frozen=True)
class ListRuns:
    """List the stored runs again: other programs fly too."""


@dataclass(frozen=True)
class OpenRun:
    """Show a stored run, in its place."""

    name: str


@dataclass(frozen=True)
class CompareRun:
    """Show a second flight beside the first; None: no second one any more."""

    name: str | None


@dataclass(frozen=True)
class RenameRun:
    """Give a stored run another name."""

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
    """What a browser sends: it may be anything."""


@dataclass(frozen=True)
class PlayBack:
    """Let the timeline run, or hold it."""

    on: bool


RunAction = ListRuns | OpenRun | CompareRun | RenameRun | DeleteRun | Scrub | PlayBack


TimedRecord = FlightRecord | TrackRecord
"""What a timeline goes along: at most one of them is on the page."""
AnyTimedRecord = TypeVar("AnyTimedRecord", bound=FlightRecord | TrackRecord)


@dataclass(frozen=True)
class StoredFlight:
    """A stored run with all its steps."""

    entry: StoredRun
    record: FlightRecord


@dataclass(frozen=True)
class RunRequest:
    """A stored run that a person wants to see."""

    id: int
    """Unique in a session."""
    name: str
    compare: bool = False
    """Whether to show it beside the flight that is shown."""


@dataclass(frozen=True)
class RunChange:
    """A stored run that is to be renamed or deleted, once."""

    id: int
    """Unique in a session."""
    name: str
    to: str | None = None
    """Its new name; None deletes it for good."""

    @property
    def verb(self) -> str:
        """What is done, for the user."""
        return "delete" if self.to is None else "rename"


@dataclass(frozen=True)
class Timeline:
    """Which time step of a flight, or frame of a track, is shown."""

    flight: TimedRecord | None = None
    """The flight or track that it belongs to; for any other it says nothing."""
    part: TimedRecord | None = None
    """The same up to the time that is shown."""
    elapsed_s: float = 0.0
    """Where it is while it runs [s]."""
    playing: bool = False

    @property
    def at(self) -> int:
        """The time step that is shown."""
        return len(self.part.steps) - 1 if self.part is not None else 0

    def moved(self, flight: TimedRecord, at: float) -> "Timeline":
        """At the time step nearest to `at`, held."""
        step = min(max(round(at), 0), len(flight.steps) - 1)
        return Timeline(flight, flight.cut(step), flight.times[step])

    def started(self, flight: TimedRecord) -> "Timeline":
        """Running; from the start where it was at the end, or showed another flight."""
        here = self if self.flight is flight and self.at < len(flight.steps) - 1 else self.moved(flight, 0)
        return replace(here, playing=True)

    def rolled(self, seconds: float) -> "Timeline":
        """After some time."""
        if not self.playing or self.flight is None:
            return self
        times, elapsed = self.flight.times, self.elapsed_s + seconds
        at = bisect_right(times, elapsed + 1e-6) - 1
        part = self.part if at == self.at else self.flight.cut(at)
        return replace(self, elapsed_s=elapsed, part=part, playing=at < len(times) - 1)


@dataclass(frozen=True)
class Runs:
    """Which runs are stored, and what of them is shown."""

    entries: tuple[StoredRun, ...] = ()
    """The newest first."""
    listed: tuple[int, ...] | None = None
    """As of when."""
    wanted: tuple[RunRequest, ...] = ()
    """Runs that are asked for and not read yet."""
    changes: tuple[RunChange, ...] = ()
    """What is to be renamed and deleted, and is not yet."""
    asked: int = 0
    """How many requests and changes there were."""
    opened: StoredFlight | None = None
    """The run that was opened last; it is shown while the session's flight is its record."""
    compared: StoredFlight | None = None
    """A second run, shown beside the first."""
    timeline: Timeline = field(default_factory=Timeline)

    def wanting(self, name: str, compare: bool = False) -> "Runs":
        """With one more request."""
        request = RunRequest(self.asked, name, compare)
        return replace(self, wanted=(*self.wanted, request), asked=self.asked + 1)

    def changing(self, name: str, to: str | None) -> "Runs":
        """With one more change."""
        change = RunChange(self.asked, name, to)
        return replace(self, changes=(*self.changes, change), asked=self.asked + 1)

    def elsewhere(self) -> "Runs":
        """In another place."""
        return replace(self, opened=None, compared=None, timeline=Timeline())

    def entry(self, name: str) -> StoredRun | None:
        """The run of that name, if there is one."""
        return next((entry for entry in self.entries if entry.name == name), None)

    def shown(self, record: AnyTimedRecord | None) -> AnyTimedRecord | None:
        """As much of a flight or track as the timeline shows."""
        if record is None or self.timeline.flight is not record:
            return record
        return cast("AnyTimedRecord | None", self.timeline.part)
