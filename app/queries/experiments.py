"""Query: which experiments and results are there, and what is in one of the results?"""

from collections.abc import Iterator
from dataclasses import dataclass, field

from nerfnav_app.queries.query import Query, Resources
from nerfnav_app.state.session import Session
from nerfnav_app.storage.experiment_store import ExperimentResult, ExperimentStore
from nerfnav_app.storage.run_store import RunStore


@dataclass(frozen=True)
class Experiments:
    """What there is."""

    known: tuple[tuple[str, str], ...] = field(default=(), compare=False)
    """Name and purpose of each experiment."""
    earlier: tuple[str, ...] = field(default=(), compare=False)
    """Folders of results, the newest first."""
    result: ExperimentResult | None = field(default=None, compare=False)
    """What was asked for."""

    @property
    def names(self) -> tuple[str, ...]:
        """The experiments that there are."""
        return tuple(name for name, _ in self.known)


@dataclass(frozen=True)
class ExperimentsQuery(Query[Experiments]):
    """Which experiments and results are there?"""

    stamp: int
    """Rises when there may be new results."""
    show: str | None
    """Name of a folder of results that is looked at."""

    @classmethod
    def pending(cls, session: Session) -> Iterator["ExperimentsQuery"]:
        """Once the list is asked for, while nothing else is computed: it takes a second the first time."""
        asked = session.experiments
        query = cls(asked.stamp, asked.show)
        if asked.stamp and session.job is None and not query.is_answered(session):
            yield query

    def answer(self, resources: Resources) -> Experiments:
        """List the experiments and the folder of results."""
        # imported when it is asked for: with their figures, experiments take long to import
        from nerfnav_app.jobs.measure.experiment import EXPERIMENTS

        store = ExperimentStore((resources.runs or RunStore()).folder)
        known = tuple((name, experiment.purpose) for name, experiment in EXPERIMENTS.items())
        return Experiments(known, store.names(), None if self.show is None else store.result(self.show))
