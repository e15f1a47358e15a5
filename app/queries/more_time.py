"""Query for the duration with which a plan keeps the robot's limits."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

from nerfnav.planner import FLYABLE, PlanOutcome
from nerfnav_app.queries.following_plan import make_plan, plan_request
from nerfnav_app.queries.query import Query, Resources
from nerfnav_app.state.plan import LONGEST_S, PlanRecord
from nerfnav_app.state.session import Session

_GROWTH, _TRIALS = 1.3, 7
"""Factor on the duration from one trial to the next, and the number of trials: up to six times as long."""


@dataclass(frozen=True)
class MoreTimeQuery(Query[float | None]):
    """Query for the duration with which a plan keeps the robot's limits [s]; None where more time does not help."""

    plan: PlanRecord = field(compare=False)
    """Plan that exceeds the limits."""

    def __eq__(self, other: object) -> bool:
        """Compare plans as objects: `plan` is kept, so that no other one can take its address."""
        return isinstance(other, MoreTimeQuery) and self.plan.latest is other.plan.latest

    def __hash__(self) -> int:
        return hash((MoreTimeQuery, id(self.plan.latest)))

    @classmethod
    def pending(cls, session: Session) -> Iterator["MoreTimeQuery"]:
        """Ask for a plan that is too fast, while no job runs."""
        plan = session.unsafe_plan
        if plan is None or session.job is not None or plan.draft or plan.settings.shortest:
            return
        if plan.outcome is PlanOutcome.OVER_LIMITS and not (query := cls(plan)).is_answered(session):
            yield query

    @classmethod
    def seconds_for(cls, plan: PlanRecord, session: Session) -> float | None:
        """Return the result, if it is that of this plan."""
        asked = cls.asked_in(session)
        return cls.result_in(session) if asked is not None and asked.plan.latest is plan.latest else None

    def answer(self, resources: Resources) -> float | None:
        """Plan with more and more time."""
        plan = self.plan
        own, seconds = resources.plan_configs.get(plan.planner), plan.settings.duration_s
        for _ in range(_TRIALS):
            seconds = round(_GROWTH * seconds + 0.05, 1)
            if seconds > LONGEST_S:
                return None
            request = plan_request(plan.settings.with_duration(seconds), plan.ends, plan.planner, own)
            outcome = make_plan(replace(request, draft=True), resources.place).outcome
            if outcome is not PlanOutcome.OVER_LIMITS:
                return seconds if outcome in FLYABLE else None
        return None
