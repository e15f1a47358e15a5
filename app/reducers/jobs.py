"""Reducer of jobs: what a person begins and cancels."""

from dataclasses import replace

from app.places.ends import opening_ends
from app.reducers.common import noticed
from app.state import actions as m
from app.state.downloads import MapWish
from app.state.experiments import StartExperiment
from app.state.job import Job, JobKind
from app.state.records import FlightRecord, PlanRecord
from app.state.session import Session

JobCommand = (
    m.StartComparison | m.StartPlan | m.StartFlight | m.FindRobot | m.TakeMap | m.Cancel | m.Reset | StartExperiment
)


def job_commanded(session: Session, command: JobCommand) -> Session:
    """The session after such a command, in an open place."""
    match command:
        case m.StartComparison():
            return begun(session, JobKind.COMPARE)
        case m.StartPlan():
            return begun(session, JobKind.PLAN)
        case m.StartFlight():
            return begun(session, JobKind.FLY)
        case StartExperiment():
            asked = replace(session, experiments=session.experiments.commanded(command))
            return begun(asked, JobKind.EXPERIMENT)
        case m.FindRobot():
            return _sought(session)
        case m.TakeMap(wish):
            return begun(session, JobKind.MAP, wish)
        case m.Cancel():
            return cancelled(session)
        case m.Reset():
            assert session.place is not None, "nothing is reset before a place is open"
            ends = session.first_ends or opening_ends(session.place, None) or session.ends
            stopped = replace(cancelled(session), plan=None, flight=None, comparison=(), search=None)
            return replace(stopped, task=session.home, ends=ends, problems={})


def begun(session: Session, kind: JobKind, map: MapWish | None = None) -> Session:
    """The session that wants a job of this kind, on a fresh record; a notice where another one runs."""
    if not session.may_begin:
        return noticed(session, "Still busy", "One thing at a time: stop what is running first.", bad=True)
    job = Job(session.jobs_begun, kind, session.ends, first_plan=session.fresh_plan if kind is JobKind.FLY else None)
    job = replace(job, pace=session.flight_settings.pace, map=map)
    fresh = replace(session, job=job, jobs_begun=session.jobs_begun + 1, seeking=False)
    if kind is JobKind.COMPARE:
        return replace(fresh, comparison=())
    if kind in (JobKind.EXPERIMENT, JobKind.FIND, JobKind.MAP, JobKind.PLACE):
        return fresh
    fresh = replace(fresh, flight=None, comparison=(), search=None)
    if kind is JobKind.PLAN:
        return replace(fresh, plan=PlanRecord(session.ends))
    return replace(fresh, plan=session.fresh_plan, flight=FlightRecord(session.ends))


def _sought(session: Session) -> Session:
    """The session that looks for the robot in the last picture of its flight."""
    if session.last_picture is None:
        return noticed(session, "No picture", "The robot has not looked around yet: let it fly first.", bad=True)
    return begun(session, JobKind.FIND)


def cancelled(session: Session) -> Session:
    """The session without its job; once a place is open, what only makes later jobs quicker is left to run."""
    if session.job is None:
        return session
    opened = session.job.kind is JobKind.OPEN and session.place is not None
    return session if opened else given_up(session)


def given_up(session: Session) -> Session:
    """The session without its job; where a place is not open yet, the place before it."""
    before = session.before
    if session.place is not None or before is None:
        return replace(session, job=None)
    return replace(before, job=None, jobs_begun=session.jobs_begun, notices=session.notices)
