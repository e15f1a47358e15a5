"""What the worker can do for this app: the jobs that the command line runs too, and answers to the page."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

from app import sensing
from app.choice import Choice
from app.ends import Ends
from app.events import JobFinished
from app.helm import Helm
from app.jobs import fly, plan, scene
from app.jobs.fly import FlyRequest
from app.jobs.plan import PlanRequest
from app.place import Place
from app.questions import (
    Answer,
    EndQuestion,
    EyeQuestion,
    PlanQuestion,
    PointQuestion,
    Question,
    Replanned,
    SliceQuestion,
    SpaceQuestion,
    ViewQuestion,
)
from app.runs.questions import RunsQuestion, RunsReport, report
from app.runs.shelf import Shelf
from app.session import Job, JobKind, Session
from nerfnav.errors import NerfnavError
from nerfnav.navigation.replan import NavigateConfig
from nerfnav.planner.fast import FastPlanConfig
from nerfnav.planner.optimize import PlanConfig
from nerfnav.planner.steps import PlanStep


@dataclass
class NavigationWork:
    """Opens places, plans and flies in them. Used by the worker's thread alone."""

    open: Callable[[str], Iterator[Any]] = scene.run
    """The job that opens a place."""
    plans: Mapping[str, PlanConfig | FastPlanConfig] = field(default_factory=dict)
    """Name of a planner to how its first plan is made; planners that are not named have settings of their own."""
    navigate: NavigateConfig = field(default_factory=NavigateConfig)
    """How a flight is flown; its `plan` gives way to the above, its noise to what the session has."""
    shelf: Shelf | None = field(default_factory=Shelf)
    """Where flights are kept; None keeps none."""
    _helm: Helm | None = None

    def begin(self, session: Session, job: Job) -> Iterator[Any]:
        """The events of a job."""
        if job.kind is JobKind.OPEN:
            return self.open(session.what)
        assert session.place is not None, "nothing but opening is asked for before the place is open"
        route = self._route(job.ends, session.choice)
        if job.kind is JobKind.PLAN:
            return plan.run(route, session.place)
        made = job.first_plan.latest if job.first_plan is not None else None
        self._helm = Helm(job)
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
                return self._replanned(question, place)
            case EndQuestion():
                return sensing.end_report(place, question)
            case PointQuestion():
                return sensing.landing(place, question)
            case ViewQuestion():
                return sensing.view(place, question)
            case EyeQuestion():
                return sensing.eye_view(place, question)
            case SpaceQuestion():
                return sensing.space_view(place, question)
            case RunsQuestion():
                return RunsReport(question) if self.shelf is None else report(self.shelf, question)
            case SliceQuestion():
                return sensing.slice_view(place, question)

    def _replanned(self, question: PlanQuestion, place: Place) -> Replanned:
        steps, summary = [], {}
        with suppress(NerfnavError):  # the ends are shown with what is wrong with them
            for event in plan.run(self._route(question.ends, question.choice), place):
                if isinstance(event, PlanStep):
                    steps.append(event)
                elif isinstance(event, JobFinished):
                    summary = event.summary
        return Replanned(question, tuple(steps), summary)

    def _route(self, ends: Ends, choice: Choice) -> PlanRequest:
        start, goal = ends.start, ends.goal
        config = self.plans.get(choice.planner)
        return PlanRequest(
            start.position, goal.position, start.yaw, goal.yaw, planner=choice.planner, config=config
        )
