"""What a person may do to a flight that is under way."""

from dataclasses import replace

from nerfnav_app.state import actions as m
from nerfnav_app.state.job import Job
from nerfnav_app.state.session import Session

Steering = m.Pause | m.Resume | m.StepOnce | m.Gust | m.CarryAway | m.FindRobot


def steered(session: Session, command: Steering) -> Session:
    """The session after such a command; unchanged where nothing flies."""
    job = session.job
    if job is None or not session.in_flight:
        return session
    flight = session.flight
    if flight is not None and isinstance(command, m.Gust):
        flight = replace(flight, gusts=(*flight.gusts, session.steps_reported))
    return replace(session, job=_asked(job, command, session.steps_reported), flight=flight)


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
