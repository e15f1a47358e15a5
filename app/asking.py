"""What the page would like to know, given the session: asked again until the session has the answer."""

from collections.abc import Iterator

from app.ends import Which
from app.look import Backdrop
from app.questions import (
    EndQuestion,
    EyeQuestion,
    PlanQuestion,
    ProfileQuestion,
    Question,
    SliceQuestion,
    Space,
    SpaceQuestion,
    ViewQuestion,
)
from app.runs.changes import runs_questions
from app.session import Session
from nerfnav.planner import planners

WIDTHS = (240, 720)
"""Of the field's renderings for a tab [pixels]: one at once, one for who looks longer."""


def questions_of(session: Session) -> tuple[Question, ...]:
    """What is not known yet, the most urgent first."""
    if session.place is None:
        return ()
    shown = (*_of_ends(session), *_of_sights(session), *_of_robot(session))
    return (*runs_questions(session), *shown, *_of_trials(session))


def _of_ends(session: Session) -> Iterator[Question]:
    if session.clicked is not None:
        yield session.clicked
    for which in Which:
        if which not in session.problems:
            yield EndQuestion(which, session.ends.of(which))
    if _wants_plan_again(session):
        yield PlanQuestion(session.ends, session.choice)


def _wants_plan_again(session: Session) -> bool:
    """Whether the ends of a plan were moved and the robot fits at both: the plan follows the hand."""
    if session.flight is not None and session.flight.steps:
        return False
    free = len(session.problems) == len(Which) and not any(session.problems.values())
    return session.plan_is_stale and session.job is None and free and planners.load(session.choice.planner).real_time


def _of_robot(session: Session) -> Iterator[Question]:
    """What the robot would see from where it believes to be, or from the ends."""
    flight, ends = session.shown_flight, session.ends
    if flight is not None and flight.steps:
        key = ("flight", session.jobs_begun, session.runs.asked, len(flight.steps))
        seen = ViewQuestion(key, (flight.steps[-1].belief.mean,))
    else:
        seen = ViewQuestion(("ends", ends), (ends.start.state(), ends.goal.state()))
    if session.view is None or session.view.question != seen:
        yield seen
    plan = session.plan
    if plan is not None and plan.latest is not None and plan.outcome is not None and session.job is None:
        asked = ProfileQuestion(id(plan.latest), plan.latest.motion)
        if session.profile is None or session.profile.question != asked:
            yield asked


def _of_trials(session: Session) -> Iterator[Question]:
    question = session.trials.question
    if question is not None and session.job is None:  # it takes a second the first time
        yield question


def _of_sights(session: Session) -> Iterator[Question]:
    look, sights = session.look, session.sights
    if look.slice is not None:
        asked = SliceQuestion(look.slice)
        if sights.slice is None or sights.slice.question != asked:
            yield asked
    for wanted, space in ((look.occupied, Space.OCCUPIED), (look.unknown, Space.UNKNOWN)):
        if wanted and space not in sights.spaces:
            yield SpaceQuestion(space)
    if look.backdrop is Backdrop.RENDER:
        for client, eye in sights.eyes.items():
            view = sights.views.get(client)
            if view is None or view.question.eye != eye:
                yield EyeQuestion(client, eye, WIDTHS[0])
            elif view.question.width < WIDTHS[-1]:
                yield EyeQuestion(client, eye, WIDTHS[-1])
