"""What the worker can do for this app: jobs, answers to the page, changes of stored runs."""

from dataclasses import dataclass
from typing import Any

from nerfnav.core.errors import NerfnavError
from nerfnav_app.places.place import Place
from nerfnav_app.queries.query import Query, Resources
from nerfnav_app.state.actions import RunChanged
from nerfnav_app.state.runs import RunChange
from nerfnav_app.text import sentence
from nerfnav_app.worker.job_starter import JobStarter


@dataclass
class NavigationBackend(JobStarter):
    """Opens places, plans and flies in them. Used by the worker's thread alone."""

    def answer(self, place: Place, query: Query[Any]) -> Any:
        """The result of a query of the page."""
        return query.answer(Resources(place, self.runs, self.plans))

    def change(self, change: RunChange) -> RunChanged:
        """Rename or delete a stored run; where that fails, what is in the way."""
        if self.runs is None:
            return RunChanged(change, "No runs are kept here.")
        try:
            if change.to is None:
                self.runs.delete(change.name)
            else:
                self.runs.rename(change.name, change.to)
        except NerfnavError as error:
            return RunChanged(change, sentence(self.runs.without_folder(str(error))))
        return RunChanged(change)
