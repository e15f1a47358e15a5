"""Reducer of job reports: steps, results and failures."""

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
from nerfnav_app.reducers import place as places
from nerfnav_app.reducers.common import add_notice, enter_place
from nerfnav_app.state.flight import LocalizationRecord
from nerfnav_app.state.job import Download, Job, JobKind, RefusedExport
from nerfnav_app.state.place import Choice, OpenPlace
from nerfnav_app.state.plan import PlanRecord
from nerfnav_app.state.session import Session
from nerfnav_app.state.view import Backdrop
from nerfnav_app.text import sentence


def apply_report(session: Session, event: e.JobReport) -> Session:
    """Apply an event of the session's job, or its end."""
    job = session.job
    if job is None:
        return session
    match event:
        case e.PlaceOpened(place):
            return _enter_opened(session, place)
        case e.SurfaceShaped(glb, rough):
            seen = replace(session, surface=glb, surface_is_rough=rough)
            return _plan_if_requested(seen, job) if glb else _show_field(session)
        case e.PlannerCompared(result):
            return replace(session, comparison=(*session.comparison, result))
        case e.FileMade(name, content):
            request = job.request
            made = None if request is None else Download(job.id, request.client, name, content)
            return replace(session, download=made)
        case e.TrajectoryRefused(refusal):
            return replace(session, refused_export=RefusedExport(refusal, replace(session, job=None).asked))
        case e.Progress(label, fraction, left_s):
            return replace(session, job=replace(job, label=label, fraction=fraction, left_s=left_s))
        case TrainStep(picture=picture):
            return session if picture is None else replace(session, job=replace(job, picture=picture))
        case PlanStep() | FilterStep() | NavigationStep():
            return _add_step(session, job, event)
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
            return _finish_job(replace(session, job=None), job, result)
        case e.JobFailed(_, message, without):
            reason = without_folder(message, session.what)
            remedy = None if without is None else OpenPlace(session.what, without)
            return add_notice(jobs.abandon_job(session), f"Could not {job.kind.verb}", reason, bad=True, remedy=remedy)
        case _:
            return session  # other events are not shown


def _enter_opened(session: Session, place: Place) -> Session:
    """Enter another place; in the first one, restore the stored session, unless its camera does not see the place."""
    there, left = enter_place(_choose_robot(session, place), place), session.saved
    if left is not None:
        box = place.field.box
        seen = left.view is not None and is_visible(left.view, box.lower.tolist(), box.upper.tolist())
        view = left.view if seen else None
        restored = history.restore_moment(replace(there, saved=None, view=view, viewed=view), left.moment)
        there = replace(restored, obstacles=there.obstacles or restored.obstacles)  # those of a file come first
    return _warn_size(there, place)


def _choose_robot(session: Session, place: Place) -> Session:
    """Choose the robot of the place's first task, where none of its tasks is for the present one, which is still the
    default, or that of the place before."""
    before = session.before.place if session.before is not None else None
    unchosen = before.tasks[0].robot if before is not None and before.tasks else Choice().robot
    fitting = [task.robot for task in place.tasks]
    if session.choice.robot != unchosen or not fitting or unchosen in fitting:
        return session
    return replace(session, choice=replace(session.choice, robot=fitting[0]))


def _show_field(session: Session) -> Session:
    """Show the field itself, with a notice that the place has no surface."""
    learned = session.place is not None and session.place.field.info.made_by == "trained"
    rendered = replace(session.view_settings, backdrop=Backdrop.RENDER)
    # what was shown before there was a field, such as cameras and points, is not its surface
    seen = replace(session, surface=None, surface_is_rough=False, view_settings=rendered)
    remedy = " Train it longer or on more pictures." if learned else ""
    return add_notice(seen, "No surface", f"This field has no surface: its fog is rendered as it is.{remedy}", bad=True)


def _warn_size(session: Session, place: Place) -> Session:
    """Add a notice where the size of the place is a guess, and implausible."""
    known = not any(guess.startswith(UNIT_ASSUMED) for guess in place.field.info.guesses)
    doubt = None if known else warn_implausible_size(float(place.field.box.size.max()))
    return session if doubt is None else add_notice(session, "Check the scale", sentence(doubt), bad=True)


def _add_step(session: Session, job: Job, event: PlanStep | FilterStep | NavigationStep) -> Session:
    if job.kind is JobKind.PLAN and session.plan is not None and isinstance(event, PlanStep):
        return replace(session, plan=session.plan.with_step(event))
    flight = session.flight
    if flight is None:
        return session
    if isinstance(event, NavigationStep):
        risky = None if job.anyway else _find_risky_plan(session, event)
        if risky is not None:
            return _keep_grounded(session, risky)
        session = replace(session, flight=flight.with_step(event))
        if event.gust_mps == 0:
            return add_notice(session, "No gust", "The robot has no clearance here: fly on, and push it later.")
        return session
    planned = session.plan is not None and session.plan.outcome is not None
    if isinstance(event, FilterStep) or flight.steps or planned:
        return replace(session, flight=flight.with_iteration(event))
    # a flight that begins without a plan makes one, which is shown as a plan
    plan = session.plan or session.new_plan(job.ends)
    plan = plan.with_step(event)
    if plan.is_unsafe and not job.anyway:
        return _keep_grounded(session, plan)
    return replace(session, plan=plan, flight=replace(flight, plan=event.motion))


def _find_risky_plan(session: Session, step: NavigationStep) -> PlanRecord | None:
    """Return the plan that a flight has made itself, where its risk is high; the risk of others was shown before."""
    plan = session.plan
    if step.index or plan is None or plan.collision_probability is not None:
        return None
    plan = replace(plan, summary={**plan.summary, "collision_probability": step.collision_probability})
    return plan if plan.is_risky else None


def _keep_grounded(session: Session, plan: PlanRecord) -> Session:
    """Keep a flight on the ground because of its first plan: where its duration was a guess, find the duration and
    then fly; else ask the user."""
    session = replace(session, job=None, plan=plan, flight=None)
    if not plan.settings.shortest:
        return replace(session, unconfirmed=plan if plan.leads else None)
    planning = jobs.begin_job(session, JobKind.PLAN)
    return planning if planning.job is None else replace(planning, job=replace(planning.job, fly_after=True))


def _plan_if_requested(session: Session, job: Job) -> Session:
    """Plan where that was requested while the place was being opened."""
    return jobs.begin_job(session, JobKind.PLAN) if job.plan_after else session


def _finish_job(session: Session, job: Job, result: e.JobResult) -> Session:
    if job.kind is JobKind.OPEN:
        return _plan_if_requested(session, job)
    if job.kind is JobKind.EXPERIMENT and result.files:
        return replace(session, experiments=session.experiments.ended(result.files[0].parent.name))
    if job.kind is JobKind.PLAN and session.plan is not None:
        quick = result.summary.get("wall_s", PlanRecord.QUICK_S) < PlanRecord.QUICK_S
        plan = replace(session.plan, summary=result.summary, replayed=0.0 if quick else None)
        session = replace(session, plan=plan)
        doubtful = session.doubtful_plan
        if job.fly_after and session.fresh_plan is not None and doubtful is None:
            return jobs.begin_job(session, JobKind.FLY)
        ask = job.fly_after and doubtful is not None and doubtful.leads
        return replace(session, unconfirmed=doubtful) if ask else session
    if job.kind is JobKind.PLACE:
        return places.open_georeferenced(session, result)
    if job.kind is JobKind.FIND:
        found = result.summary["outcome"] == RelocaliseOutcome.FOUND.name.lower()
        return add_notice(session, "Found" if found else "Not found", sentence(result.summary["advice"]), bad=not found)
    if job.kind is JobKind.TRACK and session.track is not None:
        return replace(session, track=replace(session.track, summary=result.summary))
    if job.kind is JobKind.FLY and session.flight is not None:
        felt = sum(step.gust_mps is not None for step in session.flight.steps)
        session = replace(session, flight=replace(session.flight, summary=result.summary))
        return jobs.refuse_gust(session) if job.gusts > felt else session
    return session
