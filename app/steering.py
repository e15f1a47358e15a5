"""What a person may do to a flight that is under way."""

from dataclasses import replace

from app import messages as m
from app.session import Job, JobKind, Session

Steering = m.Pause | m.Resume | m.StepOnce | m.Gust | m.CarryAway | m.FindRobot


def is_flying(session: Session) -> bool:
    """Whether there is a flight under way, be it held."""
    return session.job is not None and session.job.kind is JobKind.FLY


def steered(session: Session, command: Steering) -> Session:
    """The session after such a command; unchanged where nothing flies."""
    job = session.job
    if job is None or job.kind is not JobKind.FLY:
        return session
    return replace(session, job=_asked(job, command, session.steps_reported))


def _asked(job: Job, command: Steering, steps: int) -> Job:
    match command:
        case m.Pause():
            return replace(job, paused=True, steps_granted=steps)
        case m.Resume():
            return replace(job, paused=False)
        case m.StepOnce():
            return replace(job, paused=True, steps_granted=steps + 1)
        case m.Gust():
            return replace(job, gusts=job.gusts + 1)
        case m.CarryAway():
            return replace(job, kidnaps=job.kidnaps + 1)
        case m.FindRobot():
            return replace(job, searches=job.searches + 1)
