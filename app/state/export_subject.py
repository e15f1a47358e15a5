"""Subject of an export: the flight of a session, else its plan, as export formats take it."""

from nerfnav.export import FORMATS, Recording
from nerfnav.navigation import EpisodeOutcome
from nerfnav.planner import PlanOutcome
from nerfnav_app.state.session import Session


def name_subject(session: Session) -> str | None:
    """Name the subject: "flight", else "plan", else None."""
    if session.flight is not None and len(session.flight.steps) > 1:
        return "flight"
    return "plan" if session.plan is not None and session.plan.latest is not None else None


def find_outcome(session: Session) -> PlanOutcome | EpisodeOutcome | None:
    """Look up the outcome of the subject; None while it goes on, or without a subject."""
    subject = session.flight if name_subject(session) == "flight" else session.plan
    return None if subject is None else subject.outcome


def make_recording(session: Session) -> Recording | None:
    """Convert the flight or the plan to the record that formats take."""
    place = session.place
    if place is None:
        return None
    title = f"{place.name}, {session.task}" if session.task else place.name
    if session.flight is not None and len(session.flight.steps) > 1:
        return Recording.of_flight(session.flight.steps, place.robot, title, session.surface)
    if session.plan is not None and session.plan.latest is not None:
        return Recording.of_plan(session.plan.latest.motion, place.robot, title, session.plan.outcome)
    return None


def name_download(session: Session, format: str) -> str:
    """Name the file of a download."""
    place = session.place.name if session.place is not None else "nerfnav"
    ending = FORMATS[format].ending
    suffix = "" if format == ending else f"-{format}"
    return f"{place}-{name_subject(session)}{suffix}.{ending}"
