"""Reducer of what jobs report: their steps, results and failures."""

from dataclasses import replace

from nerfnav.estimator import FilterStep, RelocaliseOutcome, RelocaliseResult, RelocaliseStep
from nerfnav.field import TrainStep
from nerfnav.importers import UNIT_ASSUMED, warn_implausible_size
from nerfnav.navigation import NavigationStep
from nerfnav.planner import PlanStep
from nerfnav_app.jobs import events as e
from nerfnav_app.places.place import Place
from nerfnav_app.places.sources import without_folder
from nerfnav_app.places.vantage import is_visible
from nerfnav_app.reducers import history, jobs
from nerfnav_app.reducers import place as placing
from nerfnav_app.reducers.common import noticed, settled
from nerfnav_app.state.job import Download, Job, JobKind
from nerfnav_app.state.records import LocalizationRecord, PlanRecord
from nerfnav_app.state.session import Session
from nerfnav_app.state.settings import Choice
from nerfnav_app.state.view import Backdrop
from nerfnav_app.text import sentence


def reported(session: Session, event: e.JobReport) -> Session:
    """The session after what its job yielded, or after the end of the job."""
    job = session.job
    assert job is not None, "only what the wanted job tells comes here"
    match event:
        case e.PlaceOpened(place):
            return _opened(session, place)
        case e.SurfaceShaped(glb, rough):
            seen = replace(session, surface=glb, surface_is_rough=rough)
            return _planning_if_asked(seen, job) if glb else _unseen(session)
        case e.PlannerCompared(result):
            return replace(session, comparison=(*session.comparison, result))
        case e.FileMade(name, content):
            wish = job.wish
            made = None if wish is None else Download(job.id, wish.client, name, content)
            return replace(session, download=made)
        case e.Progress(label, fraction):
            left_s = job.left_s if label == job.label else None
            return replace(session, job=replace(job, label=label, fraction=fraction, left_s=left_s))
        case TrainStep():
            return replace(session, job=replace(job, left_s=event.seconds_left))
        case PlanStep() | FilterStep() | NavigationStep():
            return _step(session, job, event)
        case RelocaliseStep():
            shown, flight = session.shown_flight, session.flight
            if flight is not None and session.in_flight:
                flight = flight.with_iteration(event)
            return replace(session, flight=flight, search=LocalizationRecord(event, len(shown.steps) if shown else 0))
        case RelocaliseResult() if session.search is not None:
            return replace(session, search=replace(session.search, step=event.step, outcome=event.outcome))
        case e.FrameTracked():
            return session if session.track is None else replace(session, track=session.track.with_frame(event))
        case e.JobFinished(_, result):
            return _finished(replace(session, job=None), job, result)
        case e.JobFailed(_, message):
            told = without_folder(message, session.what)
            return noticed(jobs.given_up(session), f"Could not {job.kind.value}", told, bad=True)
        case _:
            return session  # what else jobs say is not shown


def _opened(session: Session, place: Place) -> Session:
    """The session in another place; in the one that it began with, as it was left off, but for a camera that had lost
    sight of it."""
    there, left = settled(_suited(session, place), place), session.left_off
    if left is not None:
        box = place.field.box
        seen = left.view is not None and is_visible(left.view, box.lower.tolist(), box.upper.tolist())
        view = left.view if seen else None
        there = history.restored(replace(there, left_off=None, view=view, viewed=view), left.moment)
    return _doubted(there, place)


def _suited(session: Session, place: Place) -> Session:
    """The session with the robot of the place's first task, where none of its tasks is for the one of now, and nobody
    chose that: it is what was there at first, or in the place before."""
    before = session.before.place if session.before is not None else None
    unchosen = before.tasks[0].robot if before is not None and before.tasks else Choice().robot
    fitting = [task.robot for task in place.tasks]
    if session.choice.robot != unchosen or not fitting or unchosen in fitting:
        return session
    return replace(session, choice=replace(session.choice, robot=fitting[0]))


def _unseen(session: Session) -> Session:
    """The session that shows the field itself, with a notice that the place has no surface."""
    seen = replace(session, view_settings=replace(session.view_settings, backdrop=Backdrop.RENDER))
    remedy = "train it for longer, or from more pictures; its fog is shown as it is"
    return noticed(seen, "Nothing solid", f"This field has no surface: {remedy}.", bad=True)


def _doubted(session: Session, place: Place) -> Session:
    """The session with a notice where nobody knows how long the place is, and the guess is absurd."""
    known = not any(guess.startswith(UNIT_ASSUMED) for guess in place.field.info.guesses)
    doubt = None if known else warn_implausible_size(float(place.field.box.size.max()))
    return session if doubt is None else noticed(session, "How long is a metre?", sentence(doubt), bad=True)


def _step(session: Session, job: Job, event: PlanStep | FilterStep | NavigationStep) -> Session:
    if job.kind is JobKind.PLAN and session.plan is not None and isinstance(event, PlanStep):
        return replace(session, plan=session.plan.with_step(event))
    flight = session.flight
    if flight is None:
        return session
    if isinstance(event, NavigationStep):
        return replace(session, flight=flight.with_step(event))
    planned = session.plan is not None and session.plan.outcome is not None
    if isinstance(event, FilterStep) or flight.steps or planned:
        return replace(session, flight=flight.with_iteration(event))
    # a flight that begins without a plan makes one: that is a plan like any other
    plan = session.plan or PlanRecord(job.ends, session.choice.planner, session.plan_settings)
    plan = plan.with_step(event)
    if plan.is_unsafe and not job.anyway:
        return _grounded(session, plan)
    return replace(session, plan=plan, flight=replace(flight, plan=event.motion))


def _grounded(session: Session, plan: PlanRecord) -> Session:
    """The session whose flight does not take off with its first plan: where that took a guess for its duration, the
    duration is found before it flies; else the person is asked."""
    session = replace(session, job=None, plan=plan, flight=None)
    if not plan.settings.shortest:
        return replace(session, doubt=plan if plan.leads else None)
    planning = jobs.begun(session, JobKind.PLAN)
    return planning if planning.job is None else replace(planning, job=replace(planning.job, fly_after=True))


def _planning_if_asked(session: Session, job: Job) -> Session:
    """The session that plans where that was asked for while the place was being opened."""
    return jobs.begun(session, JobKind.PLAN) if job.plan_after else session


def _finished(session: Session, job: Job, result: e.JobResult) -> Session:
    if job.kind is JobKind.OPEN:
        return _planning_if_asked(session, job)
    if job.kind is JobKind.EXPERIMENT and result.files:
        return replace(session, experiments=session.experiments.ended(result.files[0].parent.name))
    if job.kind is JobKind.PLAN and session.plan is not None:
        quick = result.summary.get("wall_s", PlanRecord.QUICK_S) < PlanRecord.QUICK_S
        plan = replace(session.plan, summary=result.summary, replayed=0.0 if quick else None)
        session = replace(session, plan=plan)
        if job.fly_after and session.fresh_plan is not None:
            return jobs.begun(session, JobKind.FLY)
        return replace(session, doubt=plan) if job.fly_after and plan.is_unsafe and plan.leads else session
    if job.kind is JobKind.PLACE:
        return placing.placed(session, result)
    if job.kind is JobKind.FIND:
        found = result.summary["outcome"] == RelocaliseOutcome.FOUND.name.lower()
        return noticed(session, "Found" if found else "Not found", sentence(result.summary["advice"]), bad=not found)
    if job.kind is JobKind.TRACK and session.track is not None:
        return replace(session, track=replace(session.track, summary=result.summary))
    if job.kind is JobKind.FLY and session.flight is not None:
        return replace(session, flight=replace(session.flight, summary=result.summary))
    return session
