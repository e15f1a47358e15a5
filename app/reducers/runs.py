"""How stored flights and the timeline change the session."""

from dataclasses import replace

from app.reducers.common import noticed
from app.state.queries import Question
from app.state.run_actions import CompareRun, DeleteRun, ListRuns, OpenRun, PlayBack, RenameRun, RunCommand, Scrub
from app.state.run_queries import Errand, RunsQuestion, RunsReport, StoredFlight
from app.state.session import Session
from nerfnav import robots


def runs_questions(session: Session) -> tuple[Question, ...]:
    """Errands for the worker: the list again whenever a job has begun or ended."""
    now = _now(session)
    stale = () if session.runs.listed == now else (RunsQuestion(now, Errand.LIST),)
    return (*session.runs.wanted, *stale)


def source_elsewhere(session: Session, name: str) -> str | None:
    """What has to be opened before a flight can be shown; None where it is open, or nobody knows."""
    entry = session.runs.entry(name)
    if entry is None or session.in_flight or session.place is None:
        return None
    here = entry.about.source == session.what or entry.about.place == session.place.name
    return None if here else entry.about.source


def commanded(session: Session, command: RunCommand) -> Session:
    """The session after what a person has asked for."""
    runs, flight = session.runs, session.flight
    match command:
        case ListRuns():
            return replace(session, runs=runs.wanting(Errand.LIST))
        case OpenRun(name):
            if session.in_flight:
                return noticed(session, "Still flying", "Stop the flight before you open another one.", bad=True)
            return replace(session, runs=runs.wanting(Errand.OPEN, name))
        case CompareRun(None):
            return replace(session, runs=replace(runs, compared=None))
        case CompareRun(str(name)):
            return replace(session, runs=runs.wanting(Errand.COMPARE, name))
        case RenameRun(name, to):
            return replace(session, runs=runs.wanting(Errand.RENAME, name, to))
        case DeleteRun(name):
            return replace(session, runs=runs.wanting(Errand.DELETE, name))
    if flight is None or not flight.steps or session.in_flight:
        return session
    match command:
        case Scrub(at):
            numeric = isinstance(at, int | float)  # a page can send anything
            return replace(session, runs=replace(runs, timeline=runs.timeline.moved(flight, at if numeric else 0)))
        case PlayBack(on):
            timeline = runs.timeline.started(flight) if on else replace(runs.timeline, playing=False)
            return replace(session, runs=replace(runs, timeline=timeline))
    return session


def reported(session: Session, report: RunsReport) -> Session:
    """The session after an errand."""
    question, runs = report.question, session.runs
    listed = _now(session) if question.errand is Errand.LIST and question.id == _now(session) else runs.listed
    left = tuple(other for other in runs.wanted if other != question)
    known = replace(session, runs=replace(runs, entries=report.entries, listed=listed, wanted=left))
    if question not in runs.wanted and question.errand is not Errand.LIST:
        return session  # nobody waits for it any more
    if report.problem is not None:
        return noticed(known, f"Could not {question.errand.value}", report.problem, bad=True)
    match question.errand:
        case Errand.OPEN if report.flight is not None:
            return _opened(known, report.flight)
        case Errand.COMPARE if report.flight is not None:
            return _compared(known, report.flight)
        case Errand.RENAME | Errand.DELETE:
            return _forgotten(known, question)
    return known


def rolled(session: Session, seconds: float) -> Session:
    """The session after some time of a running timeline."""
    timeline = session.runs.timeline
    if not timeline.playing:
        return session
    if timeline.flight is not session.flight:
        timeline = replace(timeline, playing=False)
    return replace(session, runs=replace(session.runs, timeline=timeline.rolled(seconds)))


def _opened(session: Session, stored: StoredFlight) -> Session:
    """The session with a stored flight as its flight, of the robot that flew it, between its ends."""
    place, about = session.place, stored.entry.about
    if place is None or session.in_flight:
        return session
    if about.robot not in robots.names():
        return noticed(session, "Could not open", f"There is no robot called {about.robot!r} any more.", bad=True)
    if place.robot.name != about.robot:
        place = replace(place, robot=robots.load(about.robot))
    timeline = session.runs.timeline.moved(stored.record, 0)
    return replace(
        session, place=place, choice=replace(session.choice, robot=about.robot), task=None, ends=about.ends,
        problems={}, offers={}, plan=None, flight=stored.record, search=None, view=None,
        sights=session.sights.elsewhere(), runs=replace(session.runs, opened=stored, timeline=timeline),
    )  # fmt: skip


def _compared(session: Session, stored: StoredFlight) -> Session:
    about = stored.entry.about
    if session.place is None or about.place != session.place.name:
        told = f"{stored.entry.name} was flown in {about.place}: open it first, then compare others with it."
        return noticed(session, "Another place", told, bad=True)
    return replace(session, runs=replace(session.runs, compared=stored))


def _forgotten(session: Session, question: RunsQuestion) -> Session:
    """The session where a name has changed or is gone; an opened flight stays in sight."""
    runs, entry = session.runs, session.runs.entry(question.to)
    changed = {}
    for part in ("opened", "compared"):
        stored: StoredFlight | None = getattr(runs, part)
        if stored is not None and stored.entry.name == question.name:
            changed[part] = None if entry is None else replace(stored, entry=entry)
    return replace(session, runs=replace(runs, **changed))


def _now(session: Session) -> tuple[int, ...]:
    """What changes whenever a job begins or ends; longer than the id of any errand."""
    return session.jobs_begun, int(session.job is not None)
