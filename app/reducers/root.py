"""Reducer of the whole session, one pure function: `session = reduce(session, action)`."""

from dataclasses import replace

from nerfnav_app.reducers import history, jobs, place, runs
from nerfnav_app.reducers import jobs as flight
from nerfnav_app.reducers import place as placing
from nerfnav_app.reducers.common import noticed
from nerfnav_app.reducers.job_reports import reported
from nerfnav_app.reducers.settings import adjusted, reset
from nerfnav_app.state import actions as m
from nerfnav_app.state.alignment import AlignmentAction
from nerfnav_app.state.experiments import ListExperiments, ShowResult
from nerfnav_app.state.robot_draft import EditRobot, ForgetEdits
from nerfnav_app.state.runs import OpenRun, RunAction
from nerfnav_app.state.session import Session


def reduce(session: Session, message: m.Action) -> Session:
    """The session after `message`, which can be undone where it is a move or a setting."""
    return history.remembered(session, _reduced(session, message), message)


def _reduced(session: Session, message: m.Action) -> Session:
    match message:
        case m.QueryAnswered(query, result):
            return query.apply(session, result)
        case m.RunChanged():
            return runs.changed(session, message)
        case m.Reported(job, event):
            # a cancelled job may still report: it is no longer the one that is wanted
            wanted = session.job is not None and session.job.id == job
            return reported(session, event) if wanted else session
        case m.Tick(seconds):
            return runs.rolled(_passed(session, seconds), seconds)
        case m.Tell(title, body, bad):
            return noticed(session, title, body, bad)
        case _:
            return _command(session, message)


def _passed(session: Session, seconds: float) -> Session:
    """The session with its replay moved on."""
    plan = session.plan
    if plan is None or plan.replayed is None:
        return session
    share = plan.replayed + seconds / plan.REPLAY_S
    return replace(session, plan=replace(plan, replayed=share if share < 1 else None))


def _command(session: Session, command: m.Command) -> Session:
    """The session after what a person has asked for."""
    opened = session.place
    if opened is None:  # nothing can be asked before the place is open, but to give it up
        if isinstance(command, m.OpenPlace):
            return place.opening(session, command.what)
        return jobs.cancelled(session) if isinstance(command, m.Cancel) and session.before is not None else session
    if isinstance(command, RunAction):
        elsewhere = runs.source_elsewhere(session, command.name) if isinstance(command, OpenRun) else None
        return runs.commanded(session if elsewhere is None else place.opening(session, elsewhere), command)
    if isinstance(command, AlignmentAction):
        return placing.placing_commanded(session, command)
    if isinstance(command, place.PlaceCommand):
        return place.place_commanded(session, opened, command)
    if isinstance(command, flight.Steering) and (session.in_flight or not isinstance(command, m.FindRobot)):
        return flight.steered(session, command)
    if isinstance(command, jobs.JobCommand):
        return jobs.job_commanded(session, command)
    match command:
        case m.Reset():
            return reset(session, opened)
        case m.Adjust(settings, name, value):
            return adjusted(session, settings, name, value)
        case EditRobot():
            return replace(session, robot_draft=command.of(session.robot_draft))
        case ForgetEdits():
            return replace(session, robot_draft=None)
        case m.Undo() | m.Redo():
            return history.travelled(session, command)
        case ShowResult() | ListExperiments():
            return replace(session, experiments=session.experiments.commanded(command))
    raise TypeError(f"the session knows no message of type {type(command).__name__}")
