"""Reducer of undo and redo: the session keeps the state before each move and setting."""

from collections.abc import Hashable
from dataclasses import replace

from nerfnav_app.places.ends import EndRole
from nerfnav_app.reducers.common import move_end
from nerfnav_app.reducers.place import make_choice
from nerfnav_app.state import actions as m
from nerfnav_app.state.obstacles import ChangeObstacle, ObstacleAction
from nerfnav_app.state.plan import AllowTime, RestoreWeights
from nerfnav_app.state.session import History, Moment, Session

_STEPS = (
    m.MoveEnd | m.TypeEnd | m.ChooseTask | ObstacleAction | m.Choose | m.Adjust | m.Reset | AllowTime | RestoreWeights
)


def record_step(before: Session, after: Session, action: m.Action) -> Session:
    """Record `before` as a step that can be undone, where `action` has changed the session's request."""
    landed = isinstance(action, m.QueryAnswered) and before.clicked is not None and after.clicked is None
    opened = isinstance(action, m.QueryAnswered) and after.runs.opened is not before.runs.opened
    if after.place is None or before.place is None or not (landed or opened or isinstance(action, _STEPS)):
        return after
    history = after.history
    if after.moment != before.moment:
        history = history.stepped(before.history_step, _step_key(action, before.held))
    if isinstance(action, m.MoveEnd | ChangeObstacle) and not action.held:
        history = replace(history, last=None)  # the user has let go: the next move is another step
    return after if history == after.history else replace(after, history=history)


def travel_history(session: Session, action: m.Undo | m.Redo) -> Session:
    """Undo the last step, or redo the last undo, with the plan of that time; flights stay.

    A plan that was not up to date then is made again by `nerfnav_app.queries.following_plan`.
    """
    past, future = session.history.past, session.history.future
    if not (past if isinstance(action, m.Undo) else future):
        return session
    now = session.history_step
    if isinstance(action, m.Undo):
        aim, past, future = past[-1], past[:-1], (*future, now)
    else:
        aim, past, future = future[-1], (*past, now), future[:-1]
    history = History(past, future, travels=session.history.travels + 1)
    there = replace(restore_moment(session, aim.moment), history=history)
    only_view = replace(aim.moment, view_settings=now.moment.view_settings) == now.moment
    plan = aim.plan
    if plan is None or only_view or not there.may_begin or plan.field_made_by not in ("", there.field_made_by):
        return there
    return replace(there, plan=plan)


def restore_moment(session: Session, aim: Moment) -> Session:
    """Restore the request of a moment; keep the session where its robot is not available any more."""
    place = session.place
    if place is not None and aim.choice.robot != session.choice.robot:
        session = make_choice(session, place, aim.choice)
        if session.choice.robot != aim.choice.robot:
            return session  # its file is gone or broken, as a notice says
        place = session.place
    if place is None:
        return session
    for which in EndRole:
        session = move_end(session, place, which, aim.ends.of(which))
    if aim.plan_settings.unknown is not session.plan_settings.unknown:  # which decides where the robot fits
        session = replace(session, problems={}, offers={})
    return replace(
        session, choice=aim.choice, task=aim.task, home=aim.home, home_ends=aim.home_ends, seeking=False, outside={},
        plan_settings=aim.plan_settings, flight_settings=aim.flight_settings, view_settings=aim.view_settings,
        obstacles=aim.obstacles,
    )  # fmt: skip


def _step_key(action: m.Action, held: bool) -> Hashable:
    """Key of actions that continue the same step: an end or an obstacle that is dragged, a slider that moves.

    `held`: whether the user dragged one until now.
    """
    match action:
        case m.MoveEnd(which) if action.held or held:
            return which
        case ChangeObstacle(name) if action.held or held:
            return ChangeObstacle, name
        case m.Adjust(settings, name, _):
            return settings, name
        case _:
            return None
