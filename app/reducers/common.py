"""Shared reductions: changes of the session by several messages."""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import TypeVar

from nerfnav.planner.solvers.duration import is_hurried
from nerfnav_app.places.ends import End, EndRole, Ends, default_ends
from nerfnav_app.places.place import Place
from nerfnav_app.places.sources import without_paths
from nerfnav_app.state.flight import FlightRecord
from nerfnav_app.state.place import OpenPlace
from nerfnav_app.state.plan import PlanSettings
from nerfnav_app.state.session import Notice, Session

Value = TypeVar("Value")
_NOTICES_KEPT = 5


def add_notice(
    session: Session, title: str, body: str, bad: bool = False, remedy: OpenPlace | None = None
) -> Session:
    """Add a notice; the same trouble is reported once, as long as it has the same cause."""
    number = session.notices[-1].id + 1 if session.notices else 0
    notice = Notice(number, title, without_paths(body), bad, session.asked, remedy)
    if bad and session.trouble is not None and replace(session.trouble, id=number) == notice:
        return session
    return replace(session, notices=(*session.notices, notice)[-_NOTICES_KEPT:])


def move_end(session: Session, place: Place, which: EndRole, end: End, held: bool = False) -> Session:
    """Move an end, which stays inside the box; `held` while the user still drags it."""
    end = end.clamp_inside(place.field.box, place.robot)
    if session.held and not held and place.robot.planar:  # let go: now it may drop onto the floor
        session = replace(session, problems=_without(session.problems, which), offers=_without(session.offers, which))
    if session.held != held or which in session.outside:
        session = replace(session, held=held, in_hand=None, outside=_without(session.outside, which))
    if end == session.ends.of(which):
        return session
    ends = session.ends.moved(which, end)
    return replace(
        session, ends=ends, seeking=False, task=None, problems=_without(session.problems, which),
        offers=_without(session.offers, which), flight=_redirect_flight(session, ends),
    )  # fmt: skip


def move_ends(session: Session, ends: Ends) -> Session:
    """Move both ends to where the robot stands; a plan and a flight between the ends as they were are between these."""
    given, plan, flight = session.ends, session.plan, session.flight
    if ends == given:
        return session
    if plan is not None and plan.ends == given:
        plan = replace(plan, ends=ends)
    flight = replace(flight, ends=ends) if flight is not None and flight.ends == given else None
    moved = replace(session, ends=ends, plan=plan)
    return replace(moved, flight=_redirect_flight(moved, ends) if flight is None else flight)


def type_end(session: Session, place: Place, which: EndRole, end: End) -> Session:
    """Move an end to a typed pose, or keep the typed pose aside where it lies outside."""
    if not end.misfits(place.field.box, place.robot):
        return move_end(session, place, which, end)
    return replace(session, outside={**session.outside, which: end})


def enter_place(session: Session, place: Place) -> Session:
    """Enter a place with the chosen robot, at the ends of its first task there; without one, ends are searched."""
    if place.robot.source != session.choice.robot:
        place = place.with_robot(session.choice.robot)
    name = next((task.name for task in place.tasks if task.robot == place.robot.name), None)
    ends = default_ends(place, name) or default_ends(place, None) or Ends()
    settings = choose_settings(session.plan_settings, place, ends, name)
    return replace(
        session, place=place, plan_settings=settings, task=name, home=name, home_ends=None, ends=ends,
        robot_draft=None, seeking=name is None, problems={}, offers={}, outside={}, aiming=None, clicked=None,
        results={}, view_settings=session.view_settings.for_place(splats=place.splats is not None),
    )  # fmt: skip


def choose_settings(settings: PlanSettings, place: Place, ends: Ends, task: str | None) -> PlanSettings:
    """Choose to find the duration where the present one is surely too short, or there is no task to give one."""
    distance = math.dist(ends.start.position, ends.goal.position)
    hurried = task is None or is_hurried(place.robot, distance, settings.duration_s)
    return replace(settings, shortest=settings.shortest or hurried)


def _redirect_flight(session: Session, ends: Ends) -> FlightRecord | None:
    """Redirect the flight under way to the goal after an end was moved."""
    flight = session.flight
    if flight is None or not session.in_flight:
        return flight
    moved_at = flight.goals_moved if ends.goal == flight.ends.goal else (*flight.goals_moved, len(flight.steps))
    return replace(flight, ends=Ends(flight.ends.start, ends.goal), goals_moved=moved_at)


def _without(known: Mapping[EndRole, Value], which: EndRole) -> dict[EndRole, Value]:
    return {key: value for key, value in known.items() if key is not which}
