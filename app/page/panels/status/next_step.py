"""What a person most likely wants now, as an action with the words of its button."""

from nerfnav.planner import CostWeights, PlanOutcome
from nerfnav_app.queries.more_time import MoreTimeQuery
from nerfnav_app.state.actions import Cancel, Command, StartFlight, StartPlan
from nerfnav_app.state.job import JobKind
from nerfnav_app.state.plan_actions import AllowTime, RestoreWeights
from nerfnav_app.state.session import Session

NEXT = {JobKind.PLAN: "Plan the way", JobKind.FLY: "Fly it"}


def remedy(session: Session) -> tuple[Command, str] | None:
    """What helps against a plan that is not to be flown, and what to call it; None where the page cannot help."""
    plan = session.unsafe_plan
    if plan is None or session.job is not None:
        return None
    if plan.outcome is PlanOutcome.OVER_LIMITS:
        seconds = MoreTimeQuery.seconds_for(plan, session)
        return None if seconds is None else (AllowTime(seconds), f"Allow {seconds:.1f} s")
    return (RestoreWeights(), "Restore the weights") if plan.settings.weights != CostWeights() else None


def next_step(session: Session) -> tuple[Command, str]:
    """What a person most likely wants now, and what to call it."""
    if session.job is not None and session.job.kind is not JobKind.OPEN:
        return Cancel(), "Stop now"
    plan = session.unsafe_plan
    if session.fresh_plan is not None or (plan is not None and plan.leads):
        return remedy(session) or (StartFlight(), NEXT[JobKind.FLY])
    return StartPlan(), NEXT[JobKind.PLAN]
