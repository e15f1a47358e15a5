"""Query: what is the plan between the ends as they are now, with what is set now? So it follows the hand.

A plan of a session is a request, which is carried out with its verdict, or drafted quickly for a hand that moves.
"""


from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

from nerfnav.core.errors import NerfnavError
from nerfnav.core.steps import run_steps
from nerfnav.planner import InteractivePlanner, PlannerConfig, PlanOutcome, PlanResult, PlanStep, Route, planners
from nerfnav.robots import Motion
from nerfnav_app.jobs.events import JobRun
from nerfnav_app.jobs.plan import plan
from nerfnav_app.places.derived import build_occupancy, prepare_place
from nerfnav_app.places.ends import Ends
from nerfnav_app.places.place import Place
from nerfnav_app.queries.query import Query, Resources
from nerfnav_app.state.records import PlanRecord
from nerfnav_app.state.session import Session
from nerfnav_app.state.settings import Choice, PlanSettings


@dataclass(frozen=True)
class SessionPlan:
    """A plan that was made for a session, or why there is none."""

    steps: tuple[PlanStep, ...] = field(default=(), compare=False)
    """Its iterations, then its result; empty where there is no plan."""
    summary: dict[str, Any] = field(default_factory=dict, compare=False)
    """The job's numbers; none of a draft."""
    refusal: str = ""
    """Why there is no plan."""

    @property
    def outcome(self) -> PlanOutcome | None:
        """Return the outcome of the plan; None where there is no plan."""
        return next((step.outcome for step in reversed(self.steps) if isinstance(step, PlanResult)), None)


def plan_request(settings: PlanSettings, ends: Ends, planner: str, own: PlannerConfig | None) -> plan.PlanRequest:
    """What there is to plan between some ends with what a person has set; `own` where nobody changed the weights."""
    request = plan.PlanRequest(
        ends, planner=planner, config=settings.config(planner, own), shortest=settings.shortest,
        max_collision=settings.max_collision, unknown=settings.unknown,
    )  # fmt: skip
    return request.lasting(settings.duration_s)


def planned(request: plan.PlanRequest, place: Place) -> SessionPlan:
    """Plan as the job does, verdict included."""
    planning = JobRun(plan.run(request, place))
    try:
        steps = tuple(event for event in planning if isinstance(event, PlanStep))
    except NerfnavError as error:
        return SessionPlan(refusal=str(error))
    return SessionPlan(steps, planning.result.summary)


def drafted(request: plan.PlanRequest, place: Place, last: Motion | None = None) -> SessionPlan:
    """Plan as quickly as can be with the `last` plan as warm start, and without the verdict of the mesh.

    Where a duration is to be found, the draft is as fast as the last plan: how long it must take is found at the end.
    """
    seen_as = prepare_place(place, request.unknown)
    occupancy = build_occupancy(seen_as, request.settings.occupancy, request.ends.start.position[2])
    finder = planners.load(request.planner).planner(seen_as.field, place.robot, request.settings, occupancy=occupancy)
    start, goal = request.ends.start.state(), request.ends.goal.state()
    if request.shortest and last is not None:
        request = replace(request, steps=len(last.actions), dt=last.dt * _stretch(last, request.ends))
    route = Route(start, goal, request.steps, request.dt)
    if last is not None and isinstance(finder, InteractivePlanner):
        steps = finder.replan_moved_ends(last, route)
    else:
        steps = finder.plan(route)
    try:
        return SessionPlan((run_steps(steps),))
    except NerfnavError as error:
        return SessionPlan(refusal=str(error))


def _stretch(last: Motion, ends: Ends) -> float:
    """How many times as far apart the ends are now, within a factor of two."""
    before = (last.states.position[-1] - last.states.position[0]).norm().item()
    now = (ends.goal.state().position - ends.start.state().position).norm().item()
    return min(max(now / max(before, 1e-3), 0.5), 2.0)


@dataclass(frozen=True)
class FollowingPlanQuery(Query[SessionPlan]):
    """What is the plan between these ends, by this planner with these settings?"""

    ends: Ends
    choice: Choice
    settings: PlanSettings
    draft: bool = False
    """Whether a hand still moves an end: then it is made as quickly as can be, without a verdict."""
    jobs_begun: int = field(default=0, compare=False)
    """How many jobs there were when it was asked."""
    last: Motion | None = field(default=None, compare=False)
    """The plan that was shown then: a draft begins with it."""

    @classmethod
    def pending(cls, session: Session) -> Iterator["FollowingPlanQuery"]:
        """Where a plan is not the one that is wanted now, and the planner is quick enough."""
        plan = session.plan
        if plan is None or session.job is not None or session.flight_is_shown:
            return
        wanted = session.plan_is_stale or (plan.draft and not session.held)
        if wanted and planners.load(session.choice.planner).real_time:
            last = None if plan.latest is None else plan.latest.motion
            asked = session.ends, session.choice, session.plan_settings
            yield cls(*asked, session.held, session.jobs_begun, last)

    def answer(self, resources: Resources) -> SessionPlan:
        """Plan as the job does, or as quickly as can be."""
        own = resources.plan_configs.get(self.choice.planner)
        request = plan_request(self.settings, self.ends, self.choice.planner, own)
        return drafted(request, resources.place, self.last) if self.draft else planned(request, resources.place)

    def apply(self, session: Session, result: SessionPlan) -> Session:
        """The session with the plan, unless a job has begun since or another robot was taken.

        The ends may have moved on meanwhile: what was found for earlier ones is newer than what is shown.
        """
        plan, robot = session.plan, session.choice.robot
        if plan is None or session.jobs_begun != self.jobs_begun or robot != self.choice.robot:
            return session
        if not result.steps:
            return replace(session, plan=replace(plan, refusal=result.refusal))
        record = PlanRecord(
            self.ends, self.choice.planner, self.settings, draft=self.draft, summary=result.summary
        )
        for step in result.steps:
            record = record.with_step(step)
        return replace(session, plan=record)
