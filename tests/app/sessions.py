"""Sessions that have come some way."""

from nerfnav.planner.steps import PlanOutcome
from nerfnav_app.jobs.events import JobFinished, JobResult
from nerfnav_app.reducers.root import reduce
from nerfnav_app.state import actions as m
from nerfnav_app.state.session import Session
from tests.app.doubles import plan_step


def after(session: Session, *messages: m.Action) -> Session:
    """The session after several messages."""
    for message in messages:
        session = reduce(session, message)
    return session


def reports(session: Session, *events: object) -> Session:
    """The session after its running job has reported several events."""
    for event in events:
        assert session.job is not None
        session = reduce(session, m.Reported(session.job.id, event))  # type: ignore[arg-type]
    return session


def planned(session: Session) -> Session:
    """The session after a whole plan between its ends."""
    session = after(session, m.StartPlan())
    steps = [plan_step(session.ends, 0), plan_step(session.ends, 1, PlanOutcome.CONVERGED)]
    return reports(session, *steps, JobFinished("plan", JobResult({"wall_s": 1.5})))
