"""What the worker can do for this app: the jobs that the command line runs too, and answers to the page."""

import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from app.jobs import compare_planners, fly, localize, open_place, plan
from app.jobs.events import JobEvents
from app.jobs.fly_request import FlyRequest
from app.jobs.plan_request import PlanRequest
from app.jobs.subprocess_job import in_subprocess
from app.places.ends import Ends
from app.places.place import Place
from app.queries.following_plan import plan_request
from app.queries.query import Query, Resources
from app.state.actions import RunChanged
from app.state.runs import RunChange
from app.state.session import Job, JobKind, Session
from app.storage.experiment_store import ExperimentStore
from app.storage.run_store import RunStore
from app.text import sentence
from app.worker.flight_orders import FlightOrders
from nerfnav.errors import NerfnavError
from nerfnav.navigation.replan import NavigateConfig
from nerfnav.planner import planners
from nerfnav.planner.planner import PlannerConfig


@dataclass
class NavigationBackend:
    """Opens places, plans and flies in them. Used by the worker's thread alone."""

    open: Callable[[str], JobEvents] = open_place.run
    """The job that opens a place."""
    plans: Mapping[str, PlannerConfig] = field(default_factory=dict)
    """Name of a planner to how its first plan is made; planners that are not named have settings of their own."""
    navigate: NavigateConfig = field(default_factory=NavigateConfig)
    """How a flight is flown; its noise is what the session has."""
    runs: RunStore | None = field(default_factory=RunStore)
    """Where flights are kept; None keeps none."""
    _flight_orders: FlightOrders | None = None
    _placed: tempfile.TemporaryDirectory[str] | None = None

    def begin(self, session: Session, job: Job) -> JobEvents:
        """The events of a job."""
        if job.kind is JobKind.OPEN:
            return self.open(session.what)
        assert session.place is not None, "nothing but opening is asked for before the place is open"
        if job.kind is JobKind.COMPARE:
            requests = [self._request(session, job.ends, name) for name in planners.names()]
            return compare_planners.run(requests, session.place)
        if job.kind is JobKind.PLACE:
            return self._put_right(session, job)
        if job.kind is JobKind.EXPERIMENT:
            return self._experiment(session)
        if job.kind is JobKind.FIND:
            picture = session.last_picture
            assert picture is not None, "nothing is looked for without a picture"
            return localize.find(session.place, picture)
        request = self._request(session, job.ends)
        if job.kind is JobKind.PLAN:
            return plan.run(request, session.place)
        made = job.first_plan.latest if job.first_plan is not None else None
        self._flight_orders = FlightOrders(job, session.place)
        flying = session.flight_settings
        flight = FlyRequest(
            request,
            plan=None if made is None else made.motion,
            estimator=session.choice.estimator,
            open_loop=flying.open_loop,
            seed=flying.seed,
            config=replace(self.navigate, noise=flying.noise),
            orders=self._flight_orders.orders,
            source=session.what,
            task=session.task,
            out=None if self.runs is None else self.runs.new(session.place.name),
        )
        return fly.run(flight, session.place)

    def follow(self, session: Session) -> None:
        """Let a flight know what the session wants of it now."""
        if self._flight_orders is not None:
            self._flight_orders.follow(session)

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

    def _put_right(self, session: Session, job: Job) -> JobEvents:
        from app.jobs import place_field  # slow to import, and seldom needed

        if self._placed is None:
            self._placed = tempfile.TemporaryDirectory(prefix="nerfnav-", ignore_cleanup_errors=True)
        # its own folder: the place keeps its name, and one can go back to all that were before
        out = Path(self._placed.name) / str(job.id) / f"{Path(session.what).stem}.npz"
        return place_field.run(place_field.PlaceRequest(session.what, session.placing.correction(), out))

    def _experiment(self, session: Session) -> JobEvents:
        asked = session.experiments.asked
        assert asked is not None, "an experiment is begun by who says which"
        out = ExperimentStore((self.runs or RunStore()).folder).new(asked.name)
        return in_subprocess(partial(_do_experiment, asked.name, asked.trials, out))

    def _request(self, session: Session, ends: Ends, planner: str | None = None) -> PlanRequest:
        """What the session wants to be planned, by its own planner or another one."""
        name = session.choice.planner if planner is None else planner
        return plan_request(session.plan_settings, ends, name, self.plans.get(name))


def _do_experiment(name: str, trials: int | None, out: Path) -> JobEvents:
    # imported where it is done: with their figures, experiments take long to import
    from app.jobs import experiment

    return experiment.run(experiment.ExperimentRequest(name, trials=trials, out=out))
