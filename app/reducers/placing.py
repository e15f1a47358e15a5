"""Reducer of what puts the place right by hand: its scale, its floor, its box."""

from dataclasses import replace

from nerfnav.errors import NerfnavError
from nerfnav_app.jobs.events import JobResult
from nerfnav_app.reducers.common import noticed
from nerfnav_app.reducers.jobs import begun
from nerfnav_app.reducers.place import opening
from nerfnav_app.state import placing as p
from nerfnav_app.state.session import JobKind, Session
from nerfnav_app.text import sentence


def placing_commanded(session: Session, command: p.PlacingAction) -> Session:
    """The session after such a command, in an open place."""
    placing = session.placing
    match command:
        case p.PointAt(pointing):
            fresh = replace(placing, pointing=pointing, clicked=None)
            if pointing is p.Pointing.DISTANCE:
                fresh = replace(fresh, measured=())
            elif pointing is p.Pointing.FLOOR:
                fresh = replace(fresh, floor=(), above=None, find_floor=False)
            return replace(session, placing=fresh, aiming=None)
        case p.Measure(distance):
            return replace(session, placing=replace(placing, distance=distance))
        case p.FindFloor(on):
            floor = () if on else placing.floor
            return replace(session, placing=replace(placing, find_floor=on, floor=floor, above=None))
        case p.Keep(box):
            return replace(session, placing=replace(placing, kept=box))
        case p.ForgetPlacing():
            return replace(session, placing=p.Placing(undo=placing.undo))
        case p.ApplyPlacing():
            return _applied(session)
        case p.UndoPlacing():
            return _undone(session)


def placed(session: Session, result: JobResult) -> Session:
    """The session that opens the place as it was put right, and can go back to it as it was."""
    told = tuple(map(str, result.summary["changed"]))
    placing = p.Placing(undo=(*session.placing.undo, session.what), told=told)
    opened = replace(opening(session, str(result.files[0])), placing=placing)
    return noticed(opened, "Put right", sentence("; ".join(told)))


def _applied(session: Session) -> Session:
    placing = session.placing
    if len(placing.measured) == 2 and placing.distance is None:
        return noticed(session, "Not yet", "Type how far the two points are apart in truth.", bad=True)
    try:
        correction = placing.correction()
    except NerfnavError as error:
        return noticed(session, "Not changed", sentence(str(error)), bad=True)
    if correction.is_empty:
        text = "Measure something, click three points of the floor, or crop the place first."
        return noticed(session, "Nothing to change", text, bad=True)
    return begun(replace(session, placing=replace(placing, pointing=None, clicked=None)), JobKind.PLACE)


def _undone(session: Session) -> Session:
    placing = session.placing
    if not placing.undo:
        return noticed(session, "Nothing to undo", "The place is as it was opened.", bad=True)
    return replace(opening(session, placing.undo[-1]), placing=p.Placing(undo=placing.undo[:-1]))
