"""Reducer of what jobs report: their steps, results and failures."""

from dataclasses import replace

from app.jobs import events as e
from app.places.place import Place
from app.places.sources import without_folder
from app.reducers.common import noticed, settled
from app.reducers.history import restored
from app.reducers.jobs import begun, given_up
from app.reducers.placing import placed
from app.state.downloads import Download
from app.state.job import Job, JobKind
from app.state.records import PlanRecord, SearchRecord
from app.state.session import Session
from app.text import sentence
from nerfnav.estimator import FilterStep, RelocaliseOutcome, RelocaliseStep
from nerfnav.field import TrainStep
from nerfnav.importers.placement import ONE_UNIT, size_doubt
from nerfnav.navigation import NavigationStep
from nerfnav.planner import PlanStep


def reported(session: Session, event: e.JobReport) -> Session:
    """The session after what its job yielded, or after the end of the job."""
    job = session.job
    assert job is not None, "only what the wanted job tells comes here"
    match event:
        case e.PlaceOpened(place):
            there = settled(session, place)
            if session.left_off is not None:
                there = restored(replace(there, left_off=None), session.left_off)
            return _doubted(there, place)
        case e.SurfaceShaped(glb):
            return replace(session, surface=glb)
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
            return replace(session, flight=flight, search=SearchRecord(event, len(shown.steps) if shown else 0))
        case e.JobFinished(_, result):
            return _finished(replace(session, job=None), job, result)
        case e.JobFailed(_, message):
            told = without_folder(message, session.what)
            return noticed(given_up(session), f"Could not {job.kind.value}", told, bad=True)
        case _:
            return session  # what else jobs say is not shown


def _doubted(session: Session, place: Place) -> Session:
    """The session with a notice where nobody knows how long the place is, and the guess is absurd."""
    known = not any(guess.startswith(ONE_UNIT) for guess in place.field.info.guesses)
    doubt = None if known else size_doubt(float(place.field.box.size.max()))
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
    planning = begun(session, JobKind.PLAN)
    return planning if planning.job is None else replace(planning, job=replace(planning.job, then_fly=True))


def _finished(session: Session, job: Job, result: e.JobResult) -> Session:
    if job.kind is JobKind.EXPERIMENT and result.files:
        return replace(session, experiments=session.experiments.ended(result.files[0].parent.name))
    if job.kind is JobKind.PLAN and session.plan is not None:
        quick = result.summary.get("wall_s", PlanRecord.QUICK_S) < PlanRecord.QUICK_S
        plan = replace(session.plan, summary=result.summary, replayed=0.0 if quick else None)
        session = replace(session, plan=plan)
        if job.then_fly and session.fresh_plan is not None:
            return begun(session, JobKind.FLY)
        return replace(session, doubt=plan) if job.then_fly and plan.is_unsafe and plan.leads else session
    if job.kind is JobKind.PLACE:
        return placed(session, result)
    if job.kind is JobKind.FIND:
        found = result.summary["outcome"] == RelocaliseOutcome.FOUND.name.lower()
        return noticed(session, "Found" if found else "Not found", sentence(result.summary["advice"]), bad=not found)
    if job.kind is JobKind.FLY and session.flight is not None:
        return replace(session, flight=replace(session.flight, summary=result.summary))
    return session
