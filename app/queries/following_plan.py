"""Query: what is the plan between the ends as they are now? So it follows the hand."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

from app.places.ends import Ends, Which
from app.queries.query import Query, Resources
from app.queries.wanted_plan import planned
from app.state.choice import Choice
from app.state.plan_settings import PlanSettings
from app.state.records import PlanRecord
from app.state.session import Session
from nerfnav.planner import PlanStep, planners


@dataclass(frozen=True)
class FollowingPlan:
    """A plan that followed the hand."""

    steps: tuple[PlanStep, ...] = field(compare=False)
    """Its iterations; empty where there is no plan."""
    summary: dict[str, Any] = field(compare=False)
    """The job's numbers."""


@dataclass(frozen=True)
class FollowingPlanQuery(Query[FollowingPlan]):
    """What is the plan between these ends, by this planner with these settings?"""

    ends: Ends
    choice: Choice
    settings: PlanSettings

    @classmethod
    def pending(cls, session: Session) -> Iterator["FollowingPlanQuery"]:
        """Where the ends of a plan were moved, the robot fits at both, and the planner is quick enough."""
        if session.flight is not None and session.flight.steps:
            return
        free = len(session.problems) == len(Which) and not any(session.problems.values())
        if session.plan_is_stale and session.job is None and free and planners.load(session.choice.planner).real_time:
            yield cls(session.ends, session.choice, session.plan_settings)

    def answer(self, resources: Resources) -> FollowingPlan:
        """Plan as the job does."""
        own = resources.plan_configs.get(self.choice.planner)
        return FollowingPlan(*planned(self.settings, self.ends, self.choice.planner, own, resources.place))

    def apply(self, session: Session, result: FollowingPlan) -> Session:
        """The session with the plan between the ends as they are now; an answer for earlier ends comes too late."""
        asked_now = (session.ends, session.choice, session.plan_settings)
        if session.job is not None or (self.ends, self.choice, self.settings) != asked_now:
            return session
        record = PlanRecord(session.ends, summary=result.summary)
        for step in result.steps:
            record = record.with_step(step)
        return replace(session, plan=record)
