"""Query for the flight of a stored run."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

from nerfnav.core.errors import NerfnavError
from nerfnav_app.queries.query import Query, Resources
from nerfnav_app.reducers.common import add_notice
from nerfnav_app.reducers.runs import compare_run, show_run
from nerfnav_app.state.flight import FlightRecord
from nerfnav_app.state.obstacles import read_placed
from nerfnav_app.state.runs import RunRequest, StoredFlight
from nerfnav_app.state.session import Session
from nerfnav_app.storage.kept_obstacles import KEPT
from nerfnav_app.storage.run_store import RunStore
from nerfnav_app.text import sentence


@dataclass(frozen=True)
class StoredRunResult:
    """A stored run, or the reason for which it cannot be read."""

    flight: StoredFlight | None = field(default=None, compare=False)
    problem: str | None = None
    """One sentence."""


@dataclass(frozen=True)
class StoredRunQuery(Query[StoredRunResult]):
    """Query for the flight of a stored run."""

    request: RunRequest

    @classmethod
    def pending(cls, session: Session) -> Iterator["StoredRunQuery"]:
        """Ask for each run that the user wants to open or compare."""
        yield from map(cls, session.runs.wanted)

    def answer(self, resources: Resources) -> StoredRunResult:
        """Read the steps of the run from disk."""
        if resources.runs is None:
            return StoredRunResult(problem="No runs are kept here.")
        try:
            return StoredRunResult(load_flight(resources.runs, self.request.name))
        except NerfnavError as error:
            return StoredRunResult(problem=sentence(resources.runs.without_folder(str(error))))

    def apply(self, session: Session, result: StoredRunResult) -> Session:
        """Show the flight, or compare it with the present one, unless the user no longer wants it."""
        if self.request not in session.runs.wanted:
            return session
        left = tuple(other for other in session.runs.wanted if other != self.request)
        session = replace(session, runs=replace(session.runs, wanted=left))
        if result.flight is None:
            verb = "compare" if self.request.compare else "open"
            return add_notice(session, f"Could not {verb}", result.problem or "", bad=True)
        return (compare_run if self.request.compare else show_run)(session, result.flight)


def load_flight(store: RunStore, name: str) -> StoredFlight:
    """Load a run as the record of a flight, with its obstacles. Raises NerfnavError where it cannot be read."""
    entry, steps = store.entry(name), store.steps(name)
    metadata = entry.metadata
    record = FlightRecord(metadata.ends, steps, plan=steps[-1].plan, summary=metadata.metrics)
    kept = store.path(name) / KEPT
    return StoredFlight(entry, record, read_placed(kept) if kept.is_file() else ())
