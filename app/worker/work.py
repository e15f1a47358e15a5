"""Protocol of the worker's work: begin a job, answer a query, change a stored run, follow the session."""

from typing import Any, Protocol

from nerfnav_app.jobs.events import JobEvents
from nerfnav_app.places.place import Place
from nerfnav_app.queries.query import Query
from nerfnav_app.state.actions import RunChanged
from nerfnav_app.state.job import Job
from nerfnav_app.state.runs import RunChange
from nerfnav_app.state.session import Session


class Work(Protocol):
    """What the worker can do."""

    def begin(self, session: Session, job: Job) -> JobEvents:
        """The events of a job, computed as they are asked for."""
        ...

    def answer(self, place: Place, query: Query[Any]) -> Any:
        """The result of a query of the page."""
        ...

    def change(self, change: RunChange) -> RunChanged:
        """Rename or delete a stored run."""
        ...

    def follow(self, session: Session) -> None:
        """Let the running job know of the session as it is now."""
        ...
