"""What the worker can do for this app: the jobs that the command line runs too, and answers to the page."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from app import sensing
from app.ends import Ends
from app.events import JobEvents, JobFinished
from app.helm import Helm
from app.jobs import compare, fly, localize, plan, scene
from app.jobs.apart import apart
from app.jobs.fly import FlyRequest
from app.jobs.plan import PlanRequest
from app.place import Place
from app.questions import (
    Answer,
    EndQuestion,
    EyeQuestion,
    PlanQuestion,
    PointQuestion,
    ProfileQuestion,
    Question,
    Replanned,
    SliceQuestion,
    SpaceQuestion,
    ViewQuestion,
)
from app.runs.questions import RunsQuestion, RunsReport, report
from app.runs.shelf import Shelf
from app.session import Job, JobKind, Session
from app.trials import drawer as trials
from app.trials.state import TrialsQuestion
from nerfnav.errors import NerfnavError
from nerfnav.navigation.replan import NavigateConfig
from nerfnav.planner import planners
from nerfnav.planner.planner import PlannerConfig
from nerfnav.planner.steps import PlanStep


@dataclass
class NavigationWork:
    """Opens places, plans and flies in them. Used by the worker's thread alone."""

    open: Callable[[str], Iterator[Any]] = scene.run
    """The job that opens a place."""
    plans: Mapping[str, PlannerConfig] = field(default_factory=dict)
    """Name of a planner to how its first plan is made; planners that are not named have settings of their own."""
    navigate: NavigateConfig = field(default_factory=NavigateConfig)
    """How a flight is flown; its noise is what the session has."""
    shelf: Shelf | None = field(default_factory=Shelf)
    """Where flights are kept; None keeps none."""
    _helm: Helm | None = None

    def begin(self, session: Session, job: Job) -> Iterator[Any]:
        """The events of a job."""
        if job.kind is JobKind.OPEN:
            return self.open(session.what)
        assert session.place is not None, "nothing but opening is asked for before the place is open"
        if job.kind is JobKind.COMPARE:
            routes = [self._route(session, job.ends, name) for name in planners.names()]
            return compare.run(routes, session.place)
        if job.kind is JobKind.EXPERIMENT:
            return self._experiment(session)
        if job.kind is JobKind.FIND:
            picture = session.last_picture
            assert picture is not None, "nothing is looked for without a picture"
            return localize.find(session.place, picture)
        route = self._route(session, job.ends)
        if job.kind is JobKind.PLAN:
            return plan.run(route, session.place)
        made = job.first_plan.latest if job.first_plan is not None else None
        self._helm = Helm(job, session.place)
        flying = session.flying
        request = FlyRequest(
            route,
            plan=None if made is None else made.motion,
            estimator=session.choice.estimator,
            open_loop=flying.open_loop,
            seed=flying.seed,
            config=replace(self.navigate, noise=flying.noise),
            orders=self._helm.orders,
            source=session.what,
            task=session.task,
            out=None if self.shelf is None else self.shelf.new(session.place.name),
        )
        return fly.run(request, session.place)

    def follow(self, session: Session) -> None:
        """Let a flight know what the session wants of it now."""
        if self._helm is not None:
            self._helm.follow(session)

    def answer(self, session: Session, question: Question) -> Answer:
        """What the page would like to know of the place."""
        place = session.place
        assert place is not None, "there are no questions before the place is open"
        match question:
            case PlanQuestion():
                return self._replanned(session, question, place)
            case EndQuestion():
                return sensing.end_report(place, question)
            case PointQuestion():
                return sensing.landing(place, question)
            case ViewQuestion():
                return sensing.view(place, question)
            case ProfileQuestion():
                return sensing.profile(place, question)
            case EyeQuestion():
                return sensing.eye_view(place, question)
            case SpaceQuestion():
                return sensing.space_view(place, question)
            case RunsQuestion():
                return RunsReport(question) if self.shelf is None else report(self.shelf, question)
            case TrialsQuestion():
                return trials.report(self._drawer, question)
            case SliceQuestion():
                return sensing.slice_view(place, question)

    @property
    def _drawer(self) -> trials.Drawer:
        return trials.Drawer((self.shelf or Shelf()).folder)

    def _experiment(self, session: Session) -> Iterator[Any]:
        asked = session.trials.asked
        assert asked is not None, "an experiment is begun by who says which"
        return apart(partial(_do_experiment, asked.name, asked.trials, self._drawer.new(asked.name)))

    def _replanned(self, session: Session, question: PlanQuestion, place: Place) -> Replanned:
        steps, summary = [], {}
        with suppress(NerfnavError):  # the ends are shown with what is wrong with them
            for event in plan.run(self._route(session, question.ends), place):
                if isinstance(event, PlanStep):
                    steps.append(event)
                elif isinstance(event, JobFinished):
                    summary = event.summary
        return Replanned(question, tuple(steps), summary)

    def _route(self, session: Session, ends: Ends, planner: str | None = None) -> PlanRequest:
        """What the session wants to be planned, by its own planner or another one."""
        settings = session.planning
        name = session.choice.planner if planner is None else planner
        config = settings.config(name, self.plans.get(name))
        route = PlanRequest(ends, planner=name, config=config, shortest=settings.shortest)
        return route.lasting(settings.duration_s)


def _do_experiment(name: str, trials: int | None, out: Path) -> JobEvents:
    # imported where it is done: with their figures, experiments take long to import
    from app.jobs import experiment

    return experiment.run(experiment.ExperimentRequest(name, trials=trials, out=out))
