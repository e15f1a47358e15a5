"""Robots on the ground stand on the floor, whatever was opened, chosen, typed, dragged or undone in which order."""

from dataclasses import replace

import pytest

import nerfnav_scenes as scenes
from nerfnav.navigation import NavigationStep
from nerfnav.robots import load
from nerfnav.world.task import Task
from nerfnav_app.jobs.events import JobFinished, PlaceOpened, SurfaceShaped
from nerfnav_app.places.ends import End, EndRole, Ends
from nerfnav_app.places.place import Place, Truth
from nerfnav_app.queries.catalog import pending_queries
from nerfnav_app.queries.first_ends import FirstEndsQuery
from nerfnav_app.queries.ground import GroundQuery
from nerfnav_app.queries.query import Resources
from nerfnav_app.state import actions as m
from nerfnav_app.state.flight import FlightRecord
from nerfnav_app.state.job import JobKind
from nerfnav_app.state.place import Choice
from nerfnav_app.state.session import SavedSession, Session
from nerfnav_app.worker.backend import NavigationBackend
from tests.app.doubles import flight_step, plan_step
from tests.app.sessions import after, reports
from tests.planner.grounds import FLOOR_M, hall

CART = "diffdrive"
HALF = 0.5 * load(CART).body.extents[2]
VOXEL = 0.02
ALOFT = End((-0.3, -0.4, 0.7))
NEAR = End((-0.6, -0.5, 0.7))
HOLE = End((0.55, -0.4, 0.5))
TASK = Task("fly", (-1.2, -0.5, 0.7), (-0.3, -0.4, 0.7))
HALL = Place("hall", hall(), None, load("quadrotor"))
WITH_TASK = replace(HALL, truth=Truth((TASK,), lambda: scenes.load("blocks")))


def opening(robot: str = "quadrotor", place: Place = HALL, saved: SavedSession | None = None) -> Session:
    """A session whose place is known, and still being shaped."""
    return reports(Session.opening("hall", Choice(robot), saved=saved), PlaceOpened(place))


def answered(session: Session) -> Session:
    """The session after the worker has answered all that concerns its ends."""
    for _ in range(6):
        asked = [query for query in pending_queries(session) if isinstance(query, FirstEndsQuery | GroundQuery)]
        if not asked:
            return session
        assert session.place is not None
        session = after(session, m.QueryAnswered(asked[0], asked[0].answer(Resources(session.place))))
    raise AssertionError("the ends never come to rest")


def driving(place: Place = HALL) -> Session:
    """A session in an open place, whose cart stands at both ends."""
    return answered(reports(opening(CART, place), JobFinished("open")))


def choosing(session: Session, robot: str) -> Session:
    return after(session, m.Choose(replace(session.choice, robot=robot)))


def assert_stands(session: Session) -> None:
    """Both ends are a few voxels above the floor, at one height, and no problem is known."""
    assert session.problems == {EndRole.START: None, EndRole.GOAL: None}
    assert session.ends.start.position[2] == session.ends.goal.position[2]
    gap = session.ends.start.position[2] - HALF - FLOOR_M
    assert 0 < gap < 4.5 * VOXEL


def test_the_robot_before_the_place() -> None:
    assert_stands(driving())


def test_the_place_before_the_robot_and_a_plan_that_was_asked_for_another_one_is_forgotten() -> None:
    asked = after(opening(), m.StartPlan())
    assert asked.job is not None and asked.job.plan_after
    chosen = choosing(asked, CART)
    assert chosen.seeking and chosen.job is not None and not chosen.job.plan_after
    shaped = reports(chosen, SurfaceShaped(b"glTF"))
    assert shaped.job is not None and shaped.job.kind is JobKind.OPEN
    assert_stands(answered(reports(shaped, JobFinished("open"))))


@pytest.mark.parametrize("command", [m.StartPlan(), m.StartFlight(), m.StartComparison()])
def test_nothing_begins_between_ends_that_are_not_found_yet(command: m.Command) -> None:
    session = choosing(reports(opening(), SurfaceShaped(b"glTF"), JobFinished("open")), CART)
    refused = after(session, command)
    assert refused.job is None and refused.seeking and refused.notices[-1].title == "Not yet"
    assert_stands(answered(refused))


@pytest.mark.parametrize("message", [m.TypeEnd, m.MoveEnd])
@pytest.mark.parametrize("which", EndRole)
def test_an_end_that_is_typed_or_dropped_in_the_air(which: EndRole, message: type[m.TypeEnd] | type[m.MoveEnd]) -> None:
    session = driving()
    moved = answered(after(session, message(which, ALOFT)))
    assert_stands(moved)
    assert moved.ends.of(which).position[:2] == ALOFT.position[:2]
    other = next(each for each in EndRole if each is not which)
    assert moved.ends.of(other) == session.ends.of(other), "an end that stands keeps its height"


def test_while_the_user_drags_an_end_it_stays_in_the_hand_and_drops_once_it_is_let_go() -> None:
    held = answered(after(driving(), m.MoveEnd(EndRole.GOAL, ALOFT, held=True)))
    assert held.ends.goal == ALOFT and held.problems[EndRole.GOAL] is None
    assert_stands(answered(after(held, m.MoveEnd(EndRole.GOAL, ALOFT))))


def test_an_end_above_a_hole_is_refused_and_one_on_the_floor_again_is_not() -> None:
    session = answered(after(driving(), m.TypeEnd(EndRole.GOAL, HOLE)))
    problem = session.problems[EndRole.GOAL]
    assert session.ends.goal == HOLE and problem is not None and "stand in the air at the goal" in problem
    assert_stands(answered(after(session, m.TypeEnd(EndRole.GOAL, ALOFT))))


def test_undo_and_redo_lead_to_ends_that_stand() -> None:
    session = driving()
    moved = answered(after(session, m.MoveEnd(EndRole.GOAL, ALOFT)))
    back = answered(after(moved, m.Undo()))
    assert back.ends == session.ends
    assert_stands(back)
    assert_stands(answered(after(back, m.Redo())))
    flown = after(choosing(moved, "quadrotor"), m.MoveEnd(EndRole.GOAL, ALOFT), m.Undo(), m.Undo())
    assert flown.choice.robot == CART
    assert_stands(answered(flown))


def test_a_saved_session_whose_ends_are_in_the_air() -> None:
    aloft = replace(driving().moment, ends=Ends(ALOFT, End((-1.2, -0.5, 0.7))))
    restored = opening(saved=SavedSession(aloft))
    assert restored.choice.robot == CART and restored.ends.start == ALOFT
    assert_stands(answered(reports(restored, JobFinished("open"))))


def test_a_task_that_was_made_for_a_robot_of_another_height() -> None:
    place = replace(HALL, truth=Truth((replace(TASK, robot=CART),), lambda: scenes.load("blocks")))
    session = driving(place)
    assert session.task == "fly"
    assert_stands(session)
    assert_stands(answered(after(session, m.MoveEnd(EndRole.GOAL, ALOFT), m.ChooseTask("fly"))))
    assert_stands(answered(after(session, m.MoveEnd(EndRole.GOAL, ALOFT), m.Reset())))


def test_a_robot_that_flew_there_before() -> None:
    flying = reports(opening(place=WITH_TASK), JobFinished("open"))
    assert flying.task == "fly" and not any(isinstance(query, GroundQuery) for query in pending_queries(flying))
    assert_stands(answered(choosing(flying, CART)))


def test_ends_that_stand_are_never_moved_and_a_long_robot_is_not_lifted_by_its_radius() -> None:
    couch = answered(reports(opening("couch"), JobFinished("open")))
    for which in EndRole:
        assert after(couch, m.MoveEnd(which, couch.ends.of(which))).ends == couch.ends
    assert answered(replace(couch, problems={})).ends == couch.ends


def test_a_plan_between_ends_that_are_put_on_the_floor_meanwhile_stays_up_to_date() -> None:
    session = after(driving(), m.MoveEnd(EndRole.GOAL, ALOFT), m.StartPlan())
    session = reports(session, plan_step(session.ends, 0))
    moved = answered(session)
    assert moved.ends != session.ends and moved.plan is not None and moved.plan.ends == moved.ends
    assert not moved.plan_is_stale


def test_a_stored_flight_in_the_air_stays_in_sight_and_its_ends_are_offered_the_floor() -> None:
    session = driving()
    aloft = Ends(ALOFT, End((-1.2, -0.5, 0.7)))
    flown = FlightRecord(aloft, (flight_step(aloft, 0), flight_step(aloft, 1)))
    shown = answered(replace(session, ends=aloft, flight=flown, problems={}, offers={}))
    assert shown.ends == aloft and shown.flight_is_shown
    assert all(shown.problems[which] is not None for which in EndRole)
    offered = after(shown, *(m.MoveEnd(which, shown.offers[which]) for which in EndRole))
    assert_stands(answered(offered))


def test_a_flight_that_begins_before_the_floor_is_known_flies_on_it() -> None:
    session = after(driving(), m.MoveEnd(EndRole.START, ALOFT), m.MoveEnd(EndRole.GOAL, NEAR), m.StartFlight())
    assert session.job is not None and session.place is not None
    backend = NavigationBackend()
    events = backend.begin(session, session.job)
    first = next(event for event in events if isinstance(event, NavigationStep))
    events.close()
    height = first.truth.position[2].item()
    assert 0 < height - HALF - FLOOR_M < 4.5 * VOXEL
    requests = backend._requests
    assert requests is not None and requests.take().goal is not None
    assert requests.take().goal.position[2].item() == pytest.approx(height, abs=1e-4)  # type: ignore[union-attr]
    landed = answered(session)
    assert landed.flight is not None and landed.flight.ends == landed.ends and not landed.flight_is_stale
    assert landed.ends.goal.position[2] == pytest.approx(height, abs=1e-3)
