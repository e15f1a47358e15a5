"""What the session asks of the shelf, and what the worker reports; the worker alone touches the disk."""

from dataclasses import dataclass, field
from enum import Enum

from app.state.records import FlightRecord
from app.storage.run_metadata import Entry
from app.storage.run_store import Shelf
from app.text import sentence
from nerfnav.errors import NerfnavError


class Errand(Enum):
    """What is to be done; the value is a verb for the user."""

    LIST = "list"
    OPEN = "open"
    COMPARE = "compare"
    RENAME = "rename"
    DELETE = "delete"


@dataclass(frozen=True)
class RunsQuestion:
    """One errand, done once."""

    id: tuple[int, ...]
    """Unique in a session."""
    errand: Errand
    name: str = ""
    """Of the flight."""
    to: str = ""
    """Its new name."""


@dataclass(frozen=True)
class StoredFlight:
    """A flight of the shelf with all its steps."""

    entry: Entry
    record: FlightRecord


@dataclass(frozen=True)
class RunsReport:
    """What came of an errand, and what is on the shelf now."""

    question: RunsQuestion
    entries: tuple[Entry, ...] = field(default=(), compare=False)
    flight: StoredFlight | None = field(default=None, compare=False)
    """Of OPEN and COMPARE."""
    problem: str | None = None
    """One sentence, or None where all is well."""


def report(shelf: Shelf, question: RunsQuestion) -> RunsReport:
    """Do an errand."""
    flight, problem = None, None
    try:
        match question.errand:
            case Errand.OPEN | Errand.COMPARE:
                flight = stored_flight(shelf, question.name)
            case Errand.RENAME:
                shelf.rename(question.name, question.to)
            case Errand.DELETE:
                shelf.delete(question.name)
            case Errand.LIST:
                pass
    except NerfnavError as error:
        problem = sentence(str(error).replace(str(shelf.folder), "the folder of flights"))
    return RunsReport(question, shelf.entries(), flight, problem)


def stored_flight(shelf: Shelf, name: str) -> StoredFlight:
    """A flight as the session has those that were just flown. Raises NerfnavError where it cannot be read."""
    entry, steps = shelf.entry(name), shelf.steps(name)
    return StoredFlight(
        entry, FlightRecord(entry.about.ends, steps, plan=steps[-1].plan, summary=entry.about.metrics)
    )
