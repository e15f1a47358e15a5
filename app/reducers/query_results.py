"""How the session takes the worker's answers."""

from dataclasses import replace

from app.places.ends import End
from app.reducers.common import moved, noticed
from app.reducers.runs import reported
from app.state import queries as q
from app.state.experiments import TrialsReport
from app.state.records import PlanRecord
from app.state.run_queries import RunsReport
from app.state.session import Session


def answered(session: Session, answer: q.Answer) -> Session:
    """The session after an answer; one to what is not asked any more changes nothing."""
    match answer:
        case q.EndReport():
            return _reported(session, answer)
        case q.View():
            return replace(session, view=answer)
        case q.Replanned():
            return _replanned(session, answer)
        case q.Landed():
            return _landed(session, answer)
        case q.Profile():
            return replace(session, profile=answer)
        case q.EyeView():
            return replace(session, sights=session.sights.seen(answer))
        case q.SpaceView():
            return replace(session, sights=session.sights.with_space(answer))
        case TrialsReport():
            return replace(session, trials=replace(session.trials, report=answer))
        case RunsReport():
            return reported(session, answer)
        case q.SliceView():
            return replace(session, sights=replace(session.sights, slice=answer))


def _reported(session: Session, answer: q.EndReport) -> Session:
    which = answer.question.which
    if session.ends.of(which) != answer.question.end:
        return session
    known = replace(session, problems={**session.problems, which: answer.problem})
    return known if answer.offer is None else replace(known, offers={**session.offers, which: answer.offer})


def _replanned(session: Session, answer: q.Replanned) -> Session:
    """The plan between the ends as they are now; an answer for earlier ends comes too late."""
    asked = answer.question
    if session.job is not None or (asked.ends, asked.choice) != (session.ends, session.choice):
        return session
    plan = PlanRecord(session.ends, summary=answer.summary)
    for step in answer.steps:
        plan = plan.with_step(step)
    return replace(session, plan=plan)


def _landed(session: Session, answer: q.Landed) -> Session:
    if session.place is None or session.clicked != answer.question:
        return session
    told = replace(session, clicked=None)
    which = answer.question.which
    if answer.position is None:
        return noticed(told, "Nothing there", f"The click met nothing to put the {which.value} on.", bad=True)
    return moved(told, session.place, which, End(answer.position, session.ends.of(which).yaw))
