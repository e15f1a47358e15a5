"""Query for the experiments, their results, and the content of one result."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field

from nerfnav.core.errors import NerfnavError
from nerfnav.core.steps import run_steps
from nerfnav_app.queries.query import Query, Resources
from nerfnav_app.state.session import Session
from nerfnav_app.storage.experiment_store import ExperimentResult, ExperimentStore
from nerfnav_app.storage.run_store import RunStore


@dataclass(frozen=True)
class Experiments:
    """Experiments and results on this machine."""

    known: tuple[tuple[str, str], ...] = field(default=(), compare=False)
    """Name and purpose of each experiment."""
    earlier: tuple[str, ...] = field(default=(), compare=False)
    """Folders of results, the newest first."""
    result: ExperimentResult | None = field(default=None, compare=False)
    """The result that was asked for."""
    report: bytes | None = field(default=None, compare=False)
    """Its report, a page of HTML; None where its folder cannot be read."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the experiments."""
        return tuple(name for name, _ in self.known)


@dataclass(frozen=True)
class ExperimentsQuery(Query[Experiments]):
    """Query for the experiments and results."""

    stamp: int
    """Rises when there may be new results."""
    show: str | None
    """Name of the folder of results to show."""

    @classmethod
    def pending(cls, session: Session) -> Iterator["ExperimentsQuery"]:
        """Ask once the list is wanted, while no job runs: it takes a second the first time."""
        asked = session.experiments
        if asked.stamp and session.job is None:
            yield cls(asked.stamp, asked.show)

    def answer(self, resources: Resources) -> Experiments:
        """List the experiments and the folder of results."""
        # slow to import, with its figures
        from nerfnav_app.jobs.measure.catalog import EXPERIMENTS
        from nerfnav_app.jobs.measure.report import make_page, read_sections

        store = ExperimentStore((resources.runs or RunStore()).folder)
        known = tuple((name, experiment.purpose) for name, experiment in EXPERIMENTS.items())
        result, report = None if self.show is None else store.result(self.show), None
        if result is not None:
            with suppress(NerfnavError):
                folder = store.folder / result.name
                report = make_page(folder, run_steps(read_sections(folder)))
        return Experiments(known, store.names(), result, report)
