"""What a person may ask of the shelf and of the timeline."""

from dataclasses import dataclass


@dataclass(frozen=True)
class ListRuns:
    """Look at the shelf again: other programs fly too."""


@dataclass(frozen=True)
class OpenRun:
    """Show a flight of the shelf, in its place."""

    name: str


@dataclass(frozen=True)
class CompareRun:
    """Show a second flight beside the first; None: no second one any more."""

    name: str | None


@dataclass(frozen=True)
class RenameRun:
    """Give a flight of the shelf another name."""

    name: str
    to: str


@dataclass(frozen=True)
class DeleteRun:
    """Delete a flight of the shelf for good."""

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


RunCommand = ListRuns | OpenRun | CompareRun | RenameRun | DeleteRun | Scrub | PlayBack
