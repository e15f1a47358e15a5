"""Protocol of the worker's work: begin a job, answer a query, change a stored run, follow the session."""

from collections.abc import Generator
from typing import Any, Protocol

from nerfnav_app.jobs.events import JobEvents
from nerfnav_app.places.place import Place
from nerfnav_app.queries.query import Query
from nerfnav_app.state.actions import RunChanged
from nerfnav_app.state.job import Job
from nerfnav_app.state.runs import RunChange
from nerfnav_app.state.session import Session


class Work(Protocol):
    """Work of a backend for the worker."""

    def begin(self, session: Session, job: Job) -> JobEvents:
        """Begin a job; its events are computed as they are taken."""
        ...

    def steps(self, place: Place, query: Query[Any]) -> Generator[None, None, Any]:
        """Answer a query of the page, step by step."""
        ...

    def change(self, change: RunChange) -> RunChanged:
        """Rename or delete a stored run."""
        ...

    def follow(self, session: Session) -> None:
        """Pass the latest session on to the running job."""
        ...
