"""Reducer of the place: open another, choose robot, task and quality, set ends, align by hand, follow tabs' cameras.

An alignment corrects turn, scale and box; its result is opened as another place, and can be undone.
"""

from dataclasses import replace

from nerfnav.core.errors import NerfnavError
from nerfnav.importers import Corners
from nerfnav_app.jobs.events import JobResult
from nerfnav_app.places.ends import Ends
from nerfnav_app.places.place import Place
from nerfnav_app.places.sources import title_of
from nerfnav_app.places.vantage import view_of_whole_box
from nerfnav_app.reducers.common import add_notice, enter_place, move_end, type_end
from nerfnav_app.reducers.jobs import begin_job, discard_results
from nerfnav_app.reducers.obstacles import end_path
from nerfnav_app.state import actions as m
from nerfnav_app.state import alignment as p
from nerfnav_app.state.alignment import Ray
from nerfnav_app.state.job import Job, JobKind
from nerfnav_app.state.obstacles import PathPoint
from nerfnav_app.state.place import Choice, Click
from nerfnav_app.state.session import Session
from nerfnav_app.state.view import CameraMoved, CameraRested, TabAction, TabClosed, to_point
from nerfnav_app.text import sentence

PlaceCommand = (
    m.MoveEnd
    | m.TypeEnd
    | m.ChooseTask
    | m.OpenPlace
    | m.ChooseQuality
    | m.ListPlaces
    | m.Choose
    | m.AimEnd
    | m.ClickScene
    | TabAction
)


def command_place(session: Session, place: Place, command: PlaceCommand) -> Session:
    """Reduce a command in the open `place`."""
    match command:
        case m.TypeEnd(which, end):
            return type_end(session, place, which, end)
        case m.MoveEnd(which, end, held):
            return move_end(session, place, which, end, held)
        case m.ChooseTask(name):
            return _choose_task(session, place, name)
        case m.OpenPlace(what, box):
            return open_place(session, what, box)
        case m.ChooseQuality(quality):
            return replace(session, quality=quality)
        case m.ListPlaces():
            return replace(session, places_asked=session.places_asked + 1)
        case m.Choose(choice):
            return make_choice(session, place, choice)
        case m.AimEnd(which) if which is not None and session.alignment.is_moving:
            return add_notice(session, *p.UNFINISHED, bad=True)
        case m.AimEnd(None):
            return replace(end_path(session), aiming=None)
        case m.AimEnd(which):
            return replace(session, aiming=which, alignment=replace(session.alignment, pointing=None))
        case m.ClickScene(ray):
            return _point(session, ray)
        case CameraMoved(client, eye):
            return replace(session, eyes={**session.eyes, client: eye}) if eye.is_sound else session
        case CameraRested(view):
            return replace(session, viewed=view)
        case TabClosed(client):
            return session.close_tab(client)


def open_place(session: Session, what: str, box: Corners | None = None) -> Session:
    """Open another place, from which the session can go back to this one."""
    job = Job(session.jobs_begun, JobKind.OPEN, label=f"Opening {title_of(what)}")
    kept = {name: getattr(session, name) for name in ("choice", "notices", "experiments", "places_asked", "quality")}
    # a place that was never open is nothing to go back to
    before = replace(session, before=None) if session.place is not None else session.before
    return Session(
        what, box, job=job, jobs_begun=session.jobs_begun + 1, runs=session.runs.elsewhere(), before=before, **kept
    )


def make_choice(session: Session, place: Place, choice: Choice) -> Session:
    """Choose another robot, planner or estimator; add a notice where one of these is unknown or invalid."""
    try:
        choice.check()
    except NerfnavError as error:
        return add_notice(session, "No such choice", sentence(str(error)), bad=True)
    changed = replace(session, choice=choice)
    if choice.robot == session.choice.robot:
        return changed
    # plans and flights belong to another body, and so does one that waits for the place
    left = discard_results(changed)
    job = None if left.job is None else replace(left.job, plan_after=False)
    return enter_place(replace(left, job=job), place)


def _choose_task(session: Session, place: Place, name: str) -> Session:
    """Choose a task: its ends, and its robot."""
    task = next((task for task in place.tasks if task.name == name), None)
    if task is None:
        return session
    if task.robot != session.choice.robot:
        session = make_choice(session, place, replace(session.choice, robot=task.robot))
    return replace(
        session, task=name, home=name, ends=Ends.of_task(task), seeking=False, problems={}, offers={}, outside={}
    )


def _point(session: Session, ray: Ray) -> Session:
    """Point at the place with a click, which moves an end or measures."""
    if session.aiming is None:
        placing = session.alignment
        if placing.pointing is None:
            return session
        return replace(session, alignment=replace(placing, clicked=ray))
    if session.aiming is PathPoint.NEXT:
        drawn = session.drawing is not None  # it may be gone, and else it has further points
        return replace(session, clicked=Click(session.aiming, ray)) if drawn else replace(session, aiming=None)
    return replace(session, clicked=Click(session.aiming, ray), aiming=None)


def command_alignment(session: Session, place: Place, command: p.AlignmentAction) -> Session:
    """Reduce a command of the alignment in the open `place`; while it is applied, nothing is changed."""
    placing = session.alignment
    if session.job is not None and session.job.kind is JobKind.PLACE:
        return session
    match command:
        case p.PickPoints(pointing):
            fresh = replace(placing, pointing=pointing, clicked=None, picked=(), finding=False)
            return replace(session, alignment=fresh, aiming=None)
        case p.FindFloor():
            return replace(session, alignment=replace(placing, pointing=None, clicked=None, finding=True))
        case p.ShowGizmo(on):
            return replace(session, alignment=replace(placing, by_hand=on))
        case p.DiscardAlignment():
            return show_all(session, place, p.AlignmentDraft(undo=placing.undo))
        case p.ApplyAlignment():
            return _apply_alignment(session)
        case p.UndoAlignment():
            return _undo_alignment(session, place)
        case _:
            return correct_place(session, place, command)


def correct_place(session: Session, place: Place, command: p.CorrectionAction) -> Session:
    """Change the correction of `place`, and look at all of it, unless a hand moves it: that sees where it goes."""
    placing, box = session.alignment, place.field.box
    try:
        match command:
            case p.PosePlace():
                moved = placing.now.posed(command.rotation, command.position, box)
                return replace(session, alignment=placing.corrected(moved, command.held))
            case p.Crop(crop, held):
                return replace(session, alignment=placing.cropped(crop, box, held))
            case p.QuarterTurn(axis):
                changed = placing.corrected(placing.now.turned(axis, box))
            case p.SetScale(scale):
                changed = placing.corrected(placing.now.scaled(scale, box))
            case p.SetDistance(distance):
                changed = placing if placing.length is None else placing.measured(distance, box)
            case p.TakePoint(point):
                changed = placing.pointed(point, box)
    except NerfnavError as error:
        dropped = replace(placing, clicked=None, pointing=None, picked=())
        return add_notice(replace(session, alignment=dropped), "Not changed", sentence(str(error)), bad=True)
    changed = replace(changed, clicked=None)
    return replace(session, alignment=changed) if changed.now == placing.now else show_all(session, place, changed)


def show_all(session: Session, place: Place, placing: p.AlignmentDraft) -> Session:
    """Take a draft, and look at all of the place as it leaves it."""
    box = placing.now.box(place.field.box)
    view = view_of_whole_box(to_point(box.lower), to_point(box.upper))
    return replace(session, alignment=placing, view=view)


def open_georeferenced(session: Session, result: JobResult) -> Session:
    """Open the georeferenced place, from which the session can go back to the place before."""
    changes = tuple(map(str, result.summary["changed"]))
    placing = p.AlignmentDraft(undo=(*session.alignment.undo, session.what), changes=changes)
    opened = replace(open_place(session, str(result.files[0])), alignment=placing)
    return add_notice(opened, "Georeferenced", sentence("; ".join(changes)))


def _apply_alignment(session: Session) -> Session:
    placing = session.alignment
    if placing.now.request().is_empty:
        text = "First turn, move or scale the place, click three points of the floor, or crop it."
        return add_notice(session, "Nothing to change", text, bad=True)
    rested = replace(placing, pointing=None, clicked=None, picked=(), by_hand=False, finding=False)
    return begin_job(replace(session, alignment=rested), JobKind.PLACE)


def _undo_alignment(session: Session, place: Place) -> Session:
    placing = session.alignment
    if placing.past:
        *past, now = placing.past
        return show_all(session, place, replace(placing, now=now, past=tuple(past), picked=(), pointing=None))
    if not placing.undo:
        return add_notice(session, "Nothing to undo", "No alignment was applied to this place.", bad=True)
    return replace(open_place(session, placing.undo[-1]), alignment=p.AlignmentDraft(undo=placing.undo[:-1]))
