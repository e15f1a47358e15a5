"""Reducer of what jobs report: their steps, results and failures."""

from dataclasses import replace

from app.jobs import events as e
from app.places.sources import without_folder
from app.reducers.common import noticed, settled
from app.reducers.jobs import given_up
from app.state.records import PlanRecord, SearchRecord
from app.state.session import Job, JobKind, Session
from app.text import sentence
from nerfnav.estimator.relocalise import RelocaliseOutcome, RelocaliseStep
from nerfnav.estimator.steps import FilterStep
from nerfnav.navigation.steps import EpisodeOutcome, NavigationStep
from nerfnav.planner.steps import PlanOutcome, PlanStep


def reported(session: Session, event: e.JobReport) -> Session:
    """The session after what its job yielded, or after the end of the job."""
    job = session.job
    assert job is not None, "only what the wanted job tells comes here"
    match event:
        case e.PlaceOpened(place):
            opened = settled(session, place)
            if place.tasks:
                return opened
            # how long ways take there, nobody knows
            return replace(opened, plan_settings=replace(opened.plan_settings, shortest=True))
        case e.SurfaceShaped(glb):
            return replace(session, surface=glb)
        case e.PlannerCompared(result):
            return replace(session, comparison=(*session.comparison, result))
        case e.Progress(label, fraction):
            return replace(session, job=replace(job, label=label, fraction=fraction))
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
    plan = session.plan if session.plan is not None else PlanRecord(job.ends)
    return replace(session, plan=plan.with_step(event), flight=replace(flight, plan=event.motion))


def _finished(session: Session, job: Job, result: e.JobResult) -> Session:
    if job.kind is JobKind.EXPERIMENT and result.files:
        return replace(session, experiments=session.experiments.ended(result.files[0].parent.name))
    if job.kind is JobKind.PLAN and session.plan is not None:
        quick = result.summary.get("wall_s", PlanRecord.QUICK_S) < PlanRecord.QUICK_S
        plan = replace(session.plan, summary=result.summary, replayed=0.0 if quick else None)
        session, outcome = replace(session, plan=plan), plan.outcome
        if outcome in (PlanOutcome.NO_PATH, PlanOutcome.DIVERGED):
            return noticed(session, "No plan", sentence(outcome.value), bad=True)
        if outcome in (PlanOutcome.LIKELY_COLLISION, PlanOutcome.TOUCHES_MESH):
            return noticed(session, "Not safe to fly", sentence(outcome.value), bad=True)
    if job.kind is JobKind.FIND:
        found = result.summary["outcome"] == RelocaliseOutcome.FOUND.name.lower()
        return noticed(session, "Found" if found else "Not found", sentence(result.summary["advice"]), bad=not found)
    if job.kind is JobKind.FLY and session.flight is not None:
        flight = replace(session.flight, summary=result.summary)
        session = replace(session, flight=flight)
        if flight.outcome is not None:
            happy = flight.outcome is EpisodeOutcome.REACHED
            title = "Arrived" if happy else "Flight ended"
            return noticed(session, title, sentence(flight.outcome.value), bad=not happy)
    return session
