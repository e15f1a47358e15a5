"""Subject of an export: the plan, the executed path or the estimate of a session, as export formats take it."""

import torch

from nerfnav.export import FORMATS, ExportFormat, Recording, Refusal, Subject, explain_unsafe
from nerfnav.navigation import EpisodeOutcome
from nerfnav.planner import PlanOutcome
from nerfnav.robots import Motion
from nerfnav_app.state.session import Session

_LEAST_STEPS = 2
"""Time steps of a flight that can be exported."""


def has_flight(session: Session) -> bool:
    """Check whether there is a flight to export."""
    return session.flight is not None and len(session.flight.steps) >= _LEAST_STEPS


def list_subjects(session: Session) -> tuple[Subject, ...]:
    """List the subjects that the session has: three after a flight, the plan alone before it, none at first."""
    if has_flight(session):
        return tuple(Subject)
    return (Subject.PLAN,) if session.plan is not None and session.plan.latest is not None else ()


def choose_subject(session: Session, form: ExportFormat) -> Subject:
    """Choose the default subject of a format."""
    return form.subjects[0] if has_flight(session) else Subject.PLAN


def find_outcome(session: Session, subject: Subject) -> PlanOutcome | EpisodeOutcome | None:
    """Look up the outcome of a subject; None while it goes on, where it is not known, or without a subject."""
    if subject is not Subject.PLAN:
        return None if session.flight is None else session.flight.outcome
    plan, flown = session.plan, _flown_plan(session)
    if flown is None:
        return None if plan is None else plan.outcome
    if plan is not None and plan.latest is not None and _is_same(plan.latest.motion, flown):
        return plan.outcome
    opened = session.runs.opened
    known = None if opened is None or opened.record is not session.flight else opened.entry.metadata.plan_outcome
    return PlanOutcome.__members__.get((known or "").upper())


def find_refusal(session: Session, subject: Subject, form: ExportFormat) -> Refusal | None:
    """Look up the reason for which a subject is not exported: its outcome, or what the worker found of its curve."""
    refusal, found = explain_unsafe(find_outcome(session, subject), form, subject), session.export_refusal
    if refusal is None and found is not None and (found.format, found.subject) == (form.name, subject):
        return found
    return refusal


def make_recording(session: Session, subject: Subject) -> Recording | None:
    """Convert a subject to the record that formats take; None where the session has none."""
    place = session.place
    if place is None or subject not in list_subjects(session):
        return None
    title = f"{place.name}, {session.task}" if session.task else place.name
    if subject is not Subject.PLAN:
        assert session.flight is not None, "listed with a flight alone"
        return Recording.of_flight(session.flight.steps, place.robot, title, session.surface, subject)
    outcome, flown = find_outcome(session, subject), _flown_plan(session)
    if flown is not None and session.flight is not None:
        return Recording.of_flight(session.flight.steps, place.robot, title, subject=subject).with_outcome(
            outcome if isinstance(outcome, PlanOutcome) else None
        )
    assert session.plan is not None and session.plan.latest is not None, "listed with a plan alone"
    return Recording.of_plan(session.plan.latest.motion, place.robot, title, session.plan.outcome)


def name_download(session: Session, format: str, subject: Subject) -> str:
    """Name the file of a download."""
    place = session.place.name if session.place is not None else "nerfnav"
    ending = FORMATS[format].ending
    suffix = "" if format == ending else f"-{format}"
    return f"{place}-{subject.value}{suffix}.{ending}"


def _flown_plan(session: Session) -> Motion | None:
    """First plan of the flight, as long as the flight is shown; then a later plan takes its place."""
    if session.flight is None or not has_flight(session):
        return None
    if session.plan is not None and session.plan.latest is not None and not session.flight_is_shown:
        return None
    first = session.flight.steps[0]
    return first.first_plan or first.plan


def _is_same(one: Motion, other: Motion) -> bool:
    return one is other or torch.equal(one.states.position, other.states.position)
