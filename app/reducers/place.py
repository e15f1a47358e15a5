"""Reducer of the place: opening another one, choosing the robot and its task, pointing at ends."""

from dataclasses import replace

from nerfnav.core.errors import NerfnavError
from nerfnav_app.places.ends import Ends
from nerfnav_app.places.place import Place
from nerfnav_app.places.sources import title_of
from nerfnav_app.reducers.common import moved, noticed, settled, typed
from nerfnav_app.reducers.jobs import emptied
from nerfnav_app.state import actions as m
from nerfnav_app.state.alignment import Ray
from nerfnav_app.state.job import Job, JobKind
from nerfnav_app.state.session import Click, Session, Vector
from nerfnav_app.state.settings import Choice
from nerfnav_app.state.tab_actions import Left, Looked, TabAction, Viewed
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
        case Looked(client, eye):
            return replace(session, eyes={**session.eyes, client: eye}) if eye.is_sound else session
        case Viewed(view):
            return replace(session, viewed=view)
        case Left(client):
            return session.without_tab(client)


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
