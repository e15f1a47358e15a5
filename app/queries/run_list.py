"""Query for the list of stored runs."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

from nerfnav_app.queries.query import Query, Resources
from nerfnav_app.state.session import Session
from nerfnav_app.storage.run_metadata import StoredRun


@dataclass(frozen=True)
class RunListQuery(Query[tuple[StoredRun, ...]]):
    """Query for the list of stored runs, the newest first."""

    stamp: tuple[int, ...]
    """Changes whenever the list may have changed."""

    @classmethod
    def pending(cls, session: Session) -> Iterator["RunListQuery"]:
        """Ask again whenever a job has begun or ended, a run was changed, or the user asks for the list."""
        if session.runs.listed != session.run_list_stamp:
            yield cls(session.run_list_stamp)

    def answer(self, resources: Resources) -> tuple[StoredRun, ...]:
        """Read the folder of runs."""
        return () if resources.runs is None else resources.runs.entries()

    def apply(self, session: Session, result: tuple[StoredRun, ...]) -> Session:
        """Keep the list in the session."""
        return replace(session, runs=replace(session.runs, entries=result, listed=self.stamp))
