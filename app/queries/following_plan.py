"""Queries for plans: between the ends as they are now, with the settings of now, so that the plan follows the hand; and
for the duration with which a plan keeps the robot's limits.

The plan job makes them: with their verdict, or as drafts, as while a hand moves an end or an obstacle.
"""

from collections.abc import Generator, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

from nerfnav.core.errors import NerfnavError
from nerfnav.core.steps import run_steps
from nerfnav.planner import FLYABLE, PlanOutcome, PlanResult, PlanStep, planners
from nerfnav.robots import Motion
from nerfnav_app.jobs.events import JobRun
from nerfnav_app.jobs.plan import plan
from nerfnav_app.places.place import Place
from nerfnav_app.queries.placed_obstacles import PlacedObstaclesQuery
from nerfnav_app.queries.query import LongQuery, PlanQuery, Resources
from nerfnav_app.state.plan import LONGEST_S, PlanRecord
from nerfnav_app.state.session import Session

_GROWTH, _TRIALS = 1.3, 7
"""Factor on the duration from one trial to the next, and the number of trials: up to six times as long."""


@dataclass(frozen=True)
class SessionPlan:
    """A plan for a session, or the reason for which there is none."""

    steps: tuple[PlanStep, ...] = field(default=(), compare=False)
    """Iterations of the planner, then its result; of a draft the result alone; empty without a plan."""
    summary: dict[str, Any] = field(default_factory=dict, compare=False)
    """Numbers of the job; none of a draft."""
    refusal: str = ""
    """Reason for which there is no plan."""

    @property
    def outcome(self) -> PlanOutcome | None:
        """Return the outcome of the plan; None where there is no plan."""
        return next((step.outcome for step in reversed(self.steps) if isinstance(step, PlanResult)), None)


def plan_request(record: PlanRecord, resources: Resources) -> plan.PlanRequest:
    """Request the plan of a record: the first plan of a flight by the same settings."""
    settings, planner, own = record.settings, record.planner, resources.plan_configs.get(record.planner)
    request = plan.PlanRequest(
        record.ends, planner=planner, config=settings.config(planner, own), again=settings.flight_config(planner, own),
        shortest=settings.shortest, max_collision=settings.max_collision, unknown=settings.unknown,
        paper_cost=settings.paper_cost, flight=replace(resources.navigate, noise=record.flight.noise),
        world=record.flight.world, watch=resources.place.has_seen,
    )  # fmt: skip
    return request.lasting(settings.duration_s)


def make_plan(request: plan.PlanRequest, place: Place) -> SessionPlan:
    """Run the plan job to its end."""
    return run_steps(plan_in_steps(request, place))


def plan_in_steps(request: plan.PlanRequest, place: Place) -> Generator[None, None, SessionPlan]:
    """Run the plan job step by step; a draft in one step, for a hand waits for it."""
    planning, steps = JobRun(plan.run(request, place)), list[PlanStep]()
    try:
        for event in planning:
            if isinstance(event, PlanStep):
                steps.append(event)
            if not request.draft:
                yield
    except NerfnavError as error:
        return SessionPlan(refusal=str(error))
    return SessionPlan(tuple(steps[-1:] if request.draft else steps), planning.result.summary)


@dataclass(frozen=True)
class FollowingPlanQuery(LongQuery[SessionPlan]):
    """Query for the plan of a record, by the robot that was chosen then."""

    record: PlanRecord
    """Ends, planner and settings; a draft where a hand still moves an end, without a verdict."""
    robot: str
    jobs_begun: int = field(default=0, compare=False)
    """Number of jobs when it was asked."""
    travels: int = field(default=0, compare=False)
    """Number of undos and redos when it was asked."""
    last: Motion | None = field(default=None, compare=False)
    """Plan that was shown then, with which a draft begins."""

    @classmethod
    def pending(cls, session: Session) -> Iterator["FollowingPlanQuery"]:
        """Ask where the plan is not up to date, and the planner is quick enough; not between the clicks of a path, and
        not before the obstacles of the page are placed, but in a hand."""
        plan = session.plan
        if plan is None or session.job is not None or session.flight_is_shown or session.drawing is not None:
            return
        if not session.held and not all(query.is_answered(session) for query in PlacedObstaclesQuery.pending(session)):
            return
        stale = session.plan_is_stale or (plan.draft and not session.held)
        if stale and planners.load(session.choice.planner).real_time:
            last = None if plan.latest is None else plan.latest.motion
            changed = plan.obstacles != session.placed_obstacles and not plan.draft
            first = session.held or changed  # seen at once, and then judged
            record = replace(session.new_plan(session.ends), draft=first)
            yield cls(record, session.choice.robot, session.jobs_begun, session.history.travels, last)

    def steps(self, resources: Resources) -> Generator[None, None, SessionPlan]:
        """Run the plan job."""
        request = plan_request(self.record, resources)
        request = replace(request, draft=self.record.draft, warm_start=self.last)
        return plan_in_steps(request, resources.place)

    def apply(self, session: Session, result: SessionPlan) -> Session:
        """Show the plan, unless a job has begun since, another robot was taken, or undo brought another plan back.

        The ends may have moved on meanwhile: a plan for earlier ones is newer than the one that is shown.
        """
        plan, asked_in = session.plan, (self.robot, self.jobs_begun, self.travels)
        if plan is None or asked_in != (session.choice.robot, session.jobs_begun, session.history.travels):
            return session
        if not result.steps:
            return replace(session, plan=replace(plan, refusal=result.refusal))
        record = replace(self.record, summary=result.summary)
        for step in result.steps:
            record = record.with_step(step)
        return replace(session, plan=record)


class MoreTimeQuery(PlanQuery[float | None], LongQuery[float | None]):
    """Query for the duration with which a plan keeps the robot's limits [s]; None where more time does not help."""

    @classmethod
    def pending(cls, session: Session) -> Iterator["MoreTimeQuery"]:
        """Ask for a plan that is too fast, while no job runs."""
        plan = session.unsafe_plan
        if plan is None or session.job is not None or plan.draft or plan.settings.shortest:
            return
        if plan.outcome is PlanOutcome.OVER_LIMITS:
            yield cls(plan)

    def steps(self, resources: Resources) -> Generator[None, None, float | None]:
        """Plan with more and more time."""
        plan = self.plan
        seconds = plan.settings.duration_s
        for _ in range(_TRIALS):
            seconds = round(_GROWTH * seconds + 0.05, 1)
            if seconds > LONGEST_S:
                return None
            request = plan_request(replace(plan, settings=plan.settings.with_duration(seconds)), resources)
            outcome = make_plan(replace(request, draft=True), resources.place).outcome
            if outcome is not PlanOutcome.OVER_LIMITS:
                return seconds if outcome in FLYABLE else None
            yield
        return None
