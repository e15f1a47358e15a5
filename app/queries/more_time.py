"""Query for the duration with which a plan keeps the robot's limits."""

from collections.abc import Iterator
from dataclasses import replace

from nerfnav.planner import FLYABLE, PlanOutcome
from nerfnav_app.queries.following_plan import make_plan, plan_request
from nerfnav_app.queries.query import PlanQuery, Resources
from nerfnav_app.state.plan import LONGEST_S
from nerfnav_app.state.session import Session

_GROWTH, _TRIALS = 1.3, 7
"""Factor on the duration from one trial to the next, and the number of trials: up to six times as long."""


class MoreTimeQuery(PlanQuery[float | None]):
    """Query for the duration with which a plan keeps the robot's limits [s]; None where more time does not help."""

    @classmethod
    def pending(cls, session: Session) -> Iterator["MoreTimeQuery"]:
        """Ask for a plan that is too fast, while no job runs."""
        plan = session.unsafe_plan
        if plan is None or session.job is not None or plan.draft or plan.settings.shortest:
            return
        if plan.outcome is PlanOutcome.OVER_LIMITS:
            yield cls(plan)

    def answer(self, resources: Resources) -> float | None:
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
        return None
