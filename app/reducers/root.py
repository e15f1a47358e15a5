"""Reducer of the whole session, one pure function: `session = reduce(session, action)`."""

from dataclasses import replace

from nerfnav_app.reducers import history, jobs, place, runs
from nerfnav_app.reducers.common import add_notice
from nerfnav_app.reducers.job_reports import apply_report
from nerfnav_app.reducers.obstacles import command_obstacles, play_motions
from nerfnav_app.reducers.settings import adjust_setting, reset_settings
from nerfnav_app.state import actions as m
from nerfnav_app.state.alignment import AlignmentAction, UndoAlignment
from nerfnav_app.state.obstacles import ObstacleAction
from nerfnav_app.state.robot_draft import DiscardEdits, EditRobot
from nerfnav_app.state.runs import ListExperiments, OpenRun, RunAction, ShowResult
from nerfnav_app.state.session import Session


def reduce(session: Session, message: m.Action) -> Session:
    """Reduce a message; a move or a setting can be undone."""
    return history.record_step(session, _reduce(session, message), message)


def _reduce(session: Session, message: m.Action) -> Session:
    match message:
        case m.QueryAnswered(query, result):
            return query.apply(session, result)
        case m.RunChanged():
            return runs.finish_change(session, message)
        case m.Reported(job, event):
            # a cancelled job may still report: it is no longer the one that is wanted
            wanted = session.job is not None and session.job.id == job
            return apply_report(session, event) if wanted else session
        case m.Tick(seconds):
            return runs.roll_timeline(play_motions(_advance_replay(session, seconds), seconds), seconds)
        case m.Notify(title, body, bad):
            return add_notice(session, title, body, bad)
        case _:
            return _command(session, message)


def _advance_replay(session: Session, seconds: float) -> Session:
    """Advance the replay of the plan."""
    plan = session.plan
    if plan is None or plan.replayed is None:
        return session
    share = plan.replayed + seconds / plan.REPLAY_S
    return replace(session, plan=replace(plan, replayed=share if share < 1 else None))


def _command(session: Session, command: m.Command) -> Session:
    """Reduce a command of the user."""
    opened = session.place
    if opened is None:  # nothing can be asked before the place is open, but to give it up
        if isinstance(command, m.OpenPlace):
            return place.open_place(session, command.what, command.box)
        return jobs.cancel_job(session) if isinstance(command, m.Cancel) and session.before is not None else session
    if isinstance(command, RunAction):
        elsewhere = runs.find_other_source(session, command.name) if isinstance(command, OpenRun) else None
        return runs.command_runs(session if elsewhere is None else place.open_place(session, elsewhere), command)
    if isinstance(command, AlignmentAction):
        return place.command_alignment(session, opened, command)
    if isinstance(command, place.PlaceCommand):
        return place.command_place(session, opened, command)
    if isinstance(command, ObstacleAction):
        return command_obstacles(session, command)
    if isinstance(command, jobs.Steering) and (session.in_flight or not isinstance(command, m.FindRobot)):
        return jobs.steer_flight(session, command)
    if isinstance(command, jobs.JobCommand):
        return jobs.command_job(session, command)
    match command:
        case m.Reset():
            return reset_settings(session, opened)
        case m.Adjust(settings, name, value):
            return adjust_setting(session, settings, name, value)
        case EditRobot():
            return replace(session, robot_draft=command.of(session.robot_draft))
        case DiscardEdits():
            return replace(session, robot_draft=None)
        case m.Undo() if session.alignment.past:
            return place.command_alignment(session, opened, UndoAlignment())
        case m.Undo() | m.Redo():
            return history.travel_history(session, command)
        case ShowResult() | ListExperiments():
            return replace(session, experiments=session.experiments.commanded(command))
    raise TypeError(f"the session knows no message of type {type(command).__name__}")
