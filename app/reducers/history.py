"""Reducer of undo and redo: the session remembers what was asked for before each move and setting."""

from collections.abc import Hashable
from dataclasses import replace

from nerfnav_app.places.ends import EndRole
from nerfnav_app.reducers.common import moved
from nerfnav_app.reducers.place import chosen
from nerfnav_app.state import actions as m
from nerfnav_app.state.history import History, Moment
from nerfnav_app.state.records import AllowTime, RestoreWeights
from nerfnav_app.state.session import Session

_STEPS = m.MoveEnd | m.TypeEnd | m.ChooseTask | m.Choose | m.Adjust | m.Reset | AllowTime | RestoreWeights


def remembered(before: Session, after: Session, action: m.Action) -> Session:
    """`after`, which can be undone where `action` has changed what is asked for."""
    landed = isinstance(action, m.QueryAnswered) and before.clicked is not None and after.clicked is None
    if after.place is None or before.place is None or not (landed or isinstance(action, _STEPS)):
        return after
    then, history = before.moment, after.history
    if after.moment != then:
        history = history.stepped(then, _what(action, before.held))
    if isinstance(action, m.MoveEnd) and not action.held:
        history = replace(history, last=None)  # a hand has let go: the next move is another step
    return after if history == after.history else replace(after, history=history)


def travelled(session: Session, action: m.Undo | m.Redo) -> Session:
    """The session as it was asked to be before the last step, or before the last undo; plans and flights stay."""
    past, future = session.history.past, session.history.future
    if not (past if isinstance(action, m.Undo) else future):
        return session
    now = session.moment
    if isinstance(action, m.Undo):
        aim, history = past[-1], History(past[:-1], (*future, now))
    else:
        aim, history = future[-1], History((*past, now), future[:-1])
    return replace(restored(session, aim), history=history)


def restored(session: Session, aim: Moment) -> Session:
    """The session that asks for what it did at a moment; unchanged where its robot is not known any more."""
    assert session.place is not None, "there is a history only in an open place"
    if aim.choice.robot != session.choice.robot:
        session = chosen(session, session.place, aim.choice)
        if session.choice.robot != aim.choice.robot:
            return session  # its file is gone or broken, as a notice says
    place = session.place
    assert place is not None, "another robot is in the same place"
    for which in EndRole:
        session = moved(session, place, which, aim.ends.of(which))
    if aim.plan_settings.unknown is not session.plan_settings.unknown:  # which decides where the robot fits
        session = replace(session, problems={}, offers={})
    return replace(
        session, choice=aim.choice, task=aim.task, home=aim.home, home_ends=aim.home_ends, seeking=False, outside={},
        plan_settings=aim.plan_settings, flight_settings=aim.flight_settings, view_settings=aim.view_settings,
    )  # fmt: skip


def _what(action: m.Action, held: bool) -> Hashable:
    """What an action changes, where going on with it is the same step: a hand that drags, a slider that moves.

    `held`: whether a hand had an end until now.
    """
    match action:
        case m.MoveEnd(which) if action.held or held:
            return which
        case m.Adjust(settings, name, _):
            return settings, name
        case _:
            return None
