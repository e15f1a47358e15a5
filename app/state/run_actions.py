"""Actions of a person on stored runs and on the timeline."""

from dataclasses import dataclass


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
