"""Reducer of the place: open another one, choose the robot and its task, point at ends, align the place by hand.

An alignment corrects scale, floor and box; its result is opened as another place, and can be undone.
"""


from dataclasses import replace

from nerfnav.core.errors import NerfnavError
from nerfnav_app.jobs.events import JobResult
from nerfnav_app.places.ends import Ends
from nerfnav_app.places.place import Place
from nerfnav_app.places.sources import title_of
from nerfnav_app.reducers.common import moved, noticed, settled, typed
from nerfnav_app.reducers.jobs import begun, emptied
from nerfnav_app.state import actions as m
from nerfnav_app.state import alignment as p
from nerfnav_app.state.alignment import Ray
from nerfnav_app.state.job import Job, JobKind
from nerfnav_app.state.session import Click, Session, Vector
from nerfnav_app.state.settings import Choice
from nerfnav_app.state.view import CameraMoved, CameraRested, TabAction, TabClosed
from nerfnav_app.text import sentence

PlaceCommand = (
    m.MoveEnd
    | m.TypeEnd
    | m.ChooseTask
    | m.OpenPlace
    | m.ChooseQuality
    | m.ListPlaces
    | m.Choose
    | m.Aim
    | m.Point
    | TabAction
)


def place_commanded(session: Session, place: Place, command: PlaceCommand) -> Session:
    """The session after such a command, where `place` is open."""
    match command:
        case m.TypeEnd(which, end):
            return typed(session, place, which, end)
        case m.MoveEnd(which, end, held):
            return moved(session, place, which, end, held)
        case m.ChooseTask(name):
            return _chosen_task(session, place, name)
        case m.OpenPlace(what):
            return opening(session, what)
        case m.ChooseQuality(quality):
            return replace(session, quality=quality)
        case m.ListPlaces():
            return replace(session, places_asked=session.places_asked + 1)
        case m.Choose(choice):
            return chosen(session, place, choice)
        case m.Aim(which):
            return replace(session, aiming=which, placing=replace(session.placing, pointing=None))
        case m.Point(origin, direction):
            return _pointed(session, origin, direction)
        case CameraMoved(client, eye):
            return replace(session, eyes={**session.eyes, client: eye}) if eye.is_sound else session
        case CameraRested(view):
            return replace(session, viewed=view)
        case TabClosed(client):
            return session.close_tab(client)


def opening(session: Session, what: str) -> Session:
    """The session that opens another place, and can go back to this one."""
    session = replace(session, before=None) if session.place is not None else session
    job = Job(session.jobs_begun, JobKind.OPEN, label=f"Opening {title_of(what)}")
    opening = Session(what, session.choice, job=job, jobs_begun=session.jobs_begun + 1, notices=session.notices)
    kept = {name: getattr(session, name) for name in ("experiments", "places_asked", "quality")}
    opening = replace(opening, runs=session.runs.elsewhere(), **kept)
    # a place that was never open is nothing to go back to
    return replace(opening, before=session if session.place is not None else session.before)


def chosen(session: Session, place: Place, choice: Choice) -> Session:
    """The session with another robot, planner or estimator; a notice where one of these is not known or not sound."""
    try:
        choice.check()
    except NerfnavError as error:
        return noticed(session, "No such choice", sentence(str(error)), bad=True)
    changed = replace(session, choice=choice)
    if choice.robot == session.choice.robot:
        return changed
    # plans and flights are those of another body
    return settled(emptied(changed), place)


def _chosen_task(session: Session, place: Place, name: str) -> Session:
    """The session at the ends of a task, with the robot that the task is for."""
    task = next((task for task in place.tasks if task.name == name), None)
    if task is None:
        return session
    if task.robot != session.choice.robot:
        session = chosen(session, place, replace(session.choice, robot=task.robot))
    return replace(
        session, task=name, home=name, ends=Ends.of_task(task), seeking=False, problems={}, offers={}, outside={}
    )


def _pointed(session: Session, origin: Vector, direction: Vector) -> Session:
    """The session that looks where a click lands, if an end is to be put there."""
    if session.aiming is None:
        placing = session.placing
        if placing.pointing is None:
            return session
        return replace(session, placing=replace(placing, clicked=Ray(origin, direction)))
    return replace(session, clicked=Click(session.aiming, origin, direction), aiming=None)


def placing_commanded(session: Session, command: p.AlignmentAction) -> Session:
    """The session after such a command, in an open place."""
    placing = session.placing
    match command:
        case p.PickPoints(pointing):
            fresh = replace(placing, pointing=pointing, clicked=None)
            if pointing is p.PickTarget.DISTANCE:
                fresh = replace(fresh, measured=())
            elif pointing is p.PickTarget.FLOOR:
                fresh = replace(fresh, floor=(), above=None, find_floor=False)
            return replace(session, placing=fresh, aiming=None)
        case p.SetDistance(distance):
            return replace(session, placing=replace(placing, distance=distance))
        case p.FindFloor(on):
            floor = () if on else placing.floor
            return replace(session, placing=replace(placing, find_floor=on, floor=floor, above=None))
        case p.Keep(box):
            return replace(session, placing=replace(placing, kept=box))
        case p.DiscardAlignment():
            return replace(session, placing=p.AlignmentDraft(undo=placing.undo))
        case p.ApplyAlignment():
            return _applied(session)
        case p.UndoAlignment():
            return _undone(session)


def placed(session: Session, result: JobResult) -> Session:
    """The session that opens the place as it was put right, and can go back to it as it was."""
    told = tuple(map(str, result.summary["changed"]))
    placing = p.AlignmentDraft(undo=(*session.placing.undo, session.what), told=told)
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
    return replace(opening(session, placing.undo[-1]), placing=p.AlignmentDraft(undo=placing.undo[:-1]))
