"""How the session moves on: one pure function of a session and a message, `session = reduce(session, message)`."""

import math
from dataclasses import replace

from app.jobs.events import (
    JobCancelled,
    JobFailed,
    JobFinished,
    PlaceOpened,
    PlannerCompared,
    Progress,
    SurfaceShaped,
)
from app.places.ends import Ends, opening_ends
from app.places.place import Place
from app.places.sources import title_of, without_folder
from app.reducers.common import moved, noticed
from app.reducers.flight import steered
from app.reducers.runs import changed, commanded, rolled, source_elsewhere
from app.reducers.settings import adjusted
from app.registry import Choice
from app.state import actions as m
from app.state.experiments import ListExperiments, ShowResult, StartExperiment
from app.state.records import FlightRecord, PlanRecord, SearchRecord
from app.state.run_actions import CompareRun, DeleteRun, ListRuns, OpenRun, PlayBack, RenameRun, Scrub
from app.state.session import Click, Job, JobKind, Session, Vector
from app.text import sentence
from nerfnav import robots
from nerfnav.errors import UnknownNameError
from nerfnav.estimator.relocalise import RelocaliseOutcome, RelocaliseStep
from nerfnav.estimator.steps import FilterStep
from nerfnav.navigation.steps import EpisodeOutcome, NavigationStep
from nerfnav.planner.steps import PlanOutcome, PlanStep


def reduce(session: Session, message: m.Action) -> Session:
    """The session after `message`."""
    match message:
        case m.QueryAnswered(query, result):
            return query.apply(session, result)
        case m.RunChanged():
            return changed(session, message)
        case m.Reported(job, event):
            # a cancelled job may still report: it is no longer the one that is wanted
            wanted = session.job is not None and session.job.id == job
            return _report(session, event) if wanted else session
        case m.Tick(seconds):
            return rolled(_passed(session, seconds), seconds)
        case m.Tell(title, body, bad):
            return noticed(session, title, body, bad)
        case _:
            return _command(session, message)


def _passed(session: Session, seconds: float) -> Session:
    """The session with its replay moved on."""
    plan = session.plan
    if plan is None or plan.replayed is None:
        return session
    share = plan.replayed + seconds / plan.REPLAY_S
    return replace(session, plan=replace(plan, replayed=share if share < 1 else None))


def _command(session: Session, command: m.Command) -> Session:
    if session.place is None:  # nothing can be asked before the place is open, but to give it up
        if isinstance(command, m.OpenPlace):
            return _open(session, command.what)
        return _cancel(session) if isinstance(command, m.Cancel) and session.before is not None else session
    match command:
        case m.MoveEnd(which, end):
            return moved(session, session.place, which, end)
        case m.ChooseTask(name):
            ends = opening_ends(session.place, name)
            return session if ends is None else replace(session, task=name, home=name, ends=ends, problems={})
        case m.OpenPlace(what):
            return _open(session, what)
        case OpenRun(name) if (source := source_elsewhere(session, name)) is not None:
            return commanded(_open(session, source), command)
        case ListRuns() | OpenRun() | CompareRun() | RenameRun() | DeleteRun() | Scrub() | PlayBack():
            return commanded(session, command)
        case m.Choose(choice):
            return _choose(session, session.place, choice)
        case m.Aim(which):
            return replace(session, aiming=which)
        case m.Point(origin, direction):
            return _pointed(session, origin, direction)
        case m.Adjust(settings, name, value):
            return adjusted(session, settings, name, value)
        case m.Looked(client, eye):
            return replace(session, eyes={**session.eyes, client: eye}) if eye.is_sound else session
        case m.Left(client):
            return session.without_tab(client)
        case m.StartComparison():
            return _begin(session, JobKind.COMPARE)
        case StartExperiment() | ShowResult() | ListExperiments():
            session = replace(session, experiments=session.experiments.commanded(command))
            return _begin(session, JobKind.EXPERIMENT) if isinstance(command, StartExperiment) else session
        case m.FindRobot() if not session.in_flight:
            return _sought(session)
        case m.Pause() | m.Resume() | m.StepOnce() | m.Gust() | m.CarryAway() | m.FindRobot():
            return steered(session, command)
        case m.StartPlan():
            return _begin(session, JobKind.PLAN)
        case m.StartFlight():
            return _begin(session, JobKind.FLY)
        case m.Cancel():
            return _cancel(session)
        case m.Reset():
            ends = opening_ends(session.place, session.home) or session.ends
            stopped = replace(_cancel(session), plan=None, flight=None, comparison=(), search=None)
            return replace(stopped, task=session.home, ends=ends, problems={})
    raise TypeError(f"the session knows no message of type {type(command).__name__}")


def _open(session: Session, what: str) -> Session:
    """The session that opens another place, and can go back to this one."""
    session = replace(session, before=None) if session.place is not None else session
    job = Job(session.jobs_begun, JobKind.OPEN, label=f"Opening {title_of(what)}")
    opening = Session(what, session.choice, job=job, jobs_begun=session.jobs_begun + 1, notices=session.notices)
    opening = replace(opening, runs=session.runs.elsewhere())
    # a place that was never open is nothing to go back to
    return replace(opening, before=session if session.place is not None else session.before)


def _choose(session: Session, place: Place, choice: Choice) -> Session:
    try:
        choice.check()
    except UnknownNameError as error:
        return noticed(session, "No such choice", str(error), bad=True)
    chosen = replace(session, choice=choice)
    if choice.robot == session.choice.robot:
        return chosen
    # plans and flights are those of another body
    other = replace(place, robot=robots.load(choice.robot))
    return _settled(replace(_cancel(chosen), plan=None, flight=None, comparison=(), search=None), other)


def _pointed(session: Session, origin: Vector, direction: Vector) -> Session:
    """The session that looks where a click lands, if an end is to be put there."""
    if session.aiming is None or not all(map(math.isfinite, (*origin, *direction))) or not any(direction):
        return session
    return replace(session, clicked=Click(session.aiming, origin, direction), aiming=None)


def _settled(session: Session, place: Place) -> Session:
    """The session in a place, at the ends of the first task that is there for the robot."""
    tasks = place.tasks
    name = tasks[0].name if tasks else None
    ends = opening_ends(place, name) or opening_ends(place, None) or Ends()
    return replace(
        session, place=place, task=name, home=name, ends=ends, problems={}, offers={}, aiming=None, clicked=None,
        results={}, view_settings=session.view_settings.where(splats=place.splats is not None),
    )  # fmt: skip


def _begin(session: Session, kind: JobKind) -> Session:
    if not session.may_begin:
        return noticed(session, "Still busy", "One thing at a time: stop what is running first.", bad=True)
    job = Job(session.jobs_begun, kind, session.ends, first_plan=session.fresh_plan if kind is JobKind.FLY else None)
    job = replace(job, pace=session.flight_settings.pace)
    begun = replace(session, job=job, jobs_begun=session.jobs_begun + 1)
    if kind is JobKind.COMPARE:
        return replace(begun, comparison=())
    if kind in (JobKind.EXPERIMENT, JobKind.FIND):
        return begun
    begun = replace(begun, flight=None, comparison=(), search=None)
    if kind is JobKind.PLAN:
        return replace(begun, plan=PlanRecord(session.ends))
    return replace(begun, plan=session.fresh_plan, flight=FlightRecord(session.ends))


def _sought(session: Session) -> Session:
    """The session that looks for the robot in the last picture of its flight."""
    if session.last_picture is None:
        return noticed(session, "No picture", "The robot has not looked around yet: let it fly first.", bad=True)
    return _begin(session, JobKind.FIND)


def _cancel(session: Session) -> Session:
    if session.job is None:
        return session
    opened = session.job.kind is JobKind.OPEN and session.place is not None
    return session if opened else _given_up(session)


def _given_up(session: Session) -> Session:
    """The session without its job; where a place is not open yet, the place before it."""
    before = session.before
    if session.place is not None or before is None:
        return replace(session, job=None)
    return replace(before, job=None, jobs_begun=session.jobs_begun, notices=session.notices)


def _report(session: Session, event: object) -> Session:
    job = session.job
    assert job is not None
    match event:
        case PlaceOpened(place):
            return _settled(session, place)
        case SurfaceShaped(glb):
            return replace(session, surface=glb)
        case PlannerCompared(result):
            return replace(session, comparison=(*session.comparison, result))
        case Progress(label, fraction):
            return replace(session, job=replace(job, label=label, fraction=fraction))
        case PlanStep() | FilterStep() | NavigationStep():
            return _step(session, job, event)
        case RelocaliseStep():
            shown, flight = session.shown_flight, session.flight
            if flight is not None and session.in_flight:
                flight = flight.with_iteration(event)
            return replace(session, flight=flight, search=SearchRecord(event, len(shown.steps) if shown else 0))
        case JobFinished():
            return _finished(replace(session, job=None), job, event)
        case JobFailed(_, message):
            told = without_folder(message, session.what)
            return noticed(_given_up(session), f"Could not {job.kind.value}", told, bad=True)
        case JobCancelled():
            return _given_up(session)
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


def _finished(session: Session, job: Job, event: JobFinished) -> Session:
    if job.kind is JobKind.EXPERIMENT and event.files:
        return replace(session, experiments=session.experiments.ended(event.files[0].parent.name))
    if job.kind is JobKind.PLAN and session.plan is not None:
        quick = event.summary.get("wall_s", PlanRecord.QUICK_S) < PlanRecord.QUICK_S
        plan = replace(session.plan, summary=event.summary, replayed=0.0 if quick else None)
        session, outcome = replace(session, plan=plan), plan.outcome
        if outcome in (PlanOutcome.NO_PATH, PlanOutcome.DIVERGED):
            return noticed(session, "No plan", sentence(outcome.value), bad=True)
    if job.kind is JobKind.FIND:
        found = event.summary["outcome"] == RelocaliseOutcome.FOUND.name.lower()
        return noticed(session, "Found" if found else "Not found", sentence(event.summary["advice"]), bad=not found)
    if job.kind is JobKind.FLY and session.flight is not None:
        flight = replace(session.flight, summary=event.summary)
        session = replace(session, flight=flight)
        if flight.outcome is not None:
            happy = flight.outcome is EpisodeOutcome.REACHED
            title = "Arrived" if happy else "Flight ended"
            return noticed(session, title, sentence(flight.outcome.value), bad=not happy)
    return session
