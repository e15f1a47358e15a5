"""Obstacles of the page in its place: where a click lands, what is left out, and what is asked again."""

from dataclasses import replace

import numpy as np
import pytest

from nerfnav.planner import Movers
from nerfnav.robots import RigidState
from nerfnav_app.places.ends import End, EndRole
from nerfnav_app.queries.catalog import pending_queries
from nerfnav_app.queries.end_fit import check_fit
from nerfnav_app.queries.following_plan import FollowingPlanQuery, make_plan, plan_request
from nerfnav_app.queries.placed_obstacles import (
    ObstacleLandingQuery,
    ObstaclesPlaced,
    PlacedObstaclesQuery,
    WayPointQuery,
)
from nerfnav_app.queries.query import Resources
from nerfnav_app.state import actions as m
from nerfnav_app.state import obstacles as o
from nerfnav_app.state.alignment import Ray
from nerfnav_app.state.place import Click
from nerfnav_app.state.session import Session
from tests.app.doubles import balls_place
from tests.app.sessions import after, planned

PLACE = balls_place()
BUS = o.new_obstacle(o.ObstacleKind.BOX, "bus", 0.2, (-0.5, -0.8, 0.4)).changed(motion={"velocity": (1, 0, 0)})
BOX = o.new_obstacle(o.ObstacleKind.BOX, "box 1", 0.2, (0.0, 0.6, 0.4))


def answered(session: Session) -> Session:
    """The session after its obstacles were placed."""
    (asked,) = PlacedObstaclesQuery.pending(session)
    assert session.place is not None
    return after(session, m.QueryAnswered(asked, asked.answer(Resources(session.place))))


def with_obstacles(session: Session, *placed: o.PlacedObstacle) -> Session:
    return replace(session, place=PLACE, obstacles=placed)


@pytest.mark.parametrize(
    ("origin", "along", "side"),
    [
        ((0.0, 0.0, 2.0), (0.0, 0.0, -1.0), (0, 0, 1)),
        ((0.0, 2.0, 0.3), (0.0, -1.0, 0.0), (0, 1, 0)),
        ((0.05, 0.02, 2.0), (0.0, 0.0, -1.0), (0, 0, 1)),
    ],
)
def test_a_click_lets_an_obstacle_touch_what_its_ray_meets(
    origin: tuple[float, float, float], along: tuple[float, float, float], side: tuple[float, float, float]
) -> None:
    click = Click(o.ObstacleKind.BOX, Ray(origin, along))
    found = ObstacleLandingQuery(click, o.ObstacleKind.BOX, "box 1").answer(Resources(PLACE))
    assert isinstance(found, o.PlacedObstacle) and found.entry.box is not None
    size = found.entry.box[0]
    assert size == pytest.approx(2.5 * max(PLACE.robot.body.extents))
    middle = np.array([0, 0, 0.3])  # of a ball of 20 cm
    reached = (np.array(found.entry.position) - middle) @ side - 0.5 * size
    assert reached == pytest.approx(0.2, abs=0.05)


def test_a_click_into_the_void_places_nothing() -> None:
    click = Click(o.ObstacleKind.BOX, Ray((0.0, 0.0, 2.0), (0.0, 0.0, 1.0)))
    answer = ObstacleLandingQuery(click, o.ObstacleKind.BOX, "box 1").answer(Resources(PLACE))
    assert answer == "The click met nothing to put the box on: click onto a surface."


def test_a_click_onto_a_part_selects_all_of_it_by_a_box_volume(opened: Session) -> None:
    kind, ray = o.ObstacleKind.CLICKED_PART, Ray((0.0, 0.0, 2.0), (0.0, 0.0, -1.0))
    (asked,) = ObstacleLandingQuery.pending(after(opened, m.AimEnd(kind), m.ClickScene(ray)))
    assert asked.name == "box volume 1"
    found = asked.answer(Resources(PLACE))
    assert isinstance(found, o.PlacedObstacle) and found.selects and found.entry.box is not None
    np.testing.assert_allclose(found.entry.position[:2], 0.0, atol=0.05)
    assert 0.35 < min(found.entry.box) <= max(found.entry.box) < 0.6, "it holds a ball of 20 cm"
    air = ObstacleLandingQuery(Click(kind, Ray((0.0, 0.0, 2.0), (0.0, 0.0, 1.0))), kind, "box volume 1")
    assert isinstance(air.answer(Resources(PLACE)), str)


def test_obstacles_are_placed_once_and_taken_out_again(opened: Session) -> None:
    session = with_obstacles(opened, BOX)
    placed = answered(session)
    assert placed.placed_obstacles is not None and placed.place is not None
    assert placed.place.field is not PLACE.field and placed.place.without_obstacles().field is PLACE.field
    assert not [query for query in pending_queries(placed) if isinstance(query, PlacedObstaclesQuery)]
    hidden = answered(replace(placed, obstacles=(replace(BOX, hidden=True),)))
    assert hidden.placed_obstacles is None and hidden.place is not None and hidden.place.field is PLACE.field


def test_obstacles_that_cannot_be_placed_are_left_out_with_a_sentence(opened: Session) -> None:
    outside = BOX.changed(name="far", position=(9, 0, 0))
    session = answered(with_obstacles(opened, BOX, outside))
    result = PlacedObstaclesQuery.result_in(session)
    assert result is not None and set(result.problems) == {"far"} and "'far' at x 9.00" in result.problems["far"]
    assert session.placed_obstacles is not None and len(session.placed_obstacles.obstacles) == 1
    assert not [query for query in pending_queries(session) if isinstance(query, PlacedObstaclesQuery)]


def test_one_that_moves_is_beside_the_field_and_leaves_those_that_stand_alone(opened: Session) -> None:
    both = answered(with_obstacles(opened, BOX, BUS))
    assert both.place is not None and both.place.movers is not None and both.placed_obstacles is not None
    assert [each.name for each in both.placed_obstacles.obstacles] == ["box 1", "bus"]
    moved = answered(replace(both, obstacles=(BOX, BUS.changed(position=(0.3, -0.8, 0.4)))))
    assert moved.place is not None and moved.place.movers is not None
    assert moved.place.field is both.place.field, "what stands was placed again"
    assert moved.place.movers.obstacles[0].position == (0.3, -0.8, 0.4)
    assert moved.place.without_obstacles().field is PLACE.field


def test_one_that_moves_is_on_a_robot_only_while_it_is_there() -> None:
    there = RigidState.at_rest((0.5, -0.8, 0.4))
    for time, problems in ((0.0, 0), (1.0, 1), (2.0, 0)):
        found = PlacedObstaclesQuery((BUS,), robot_at=there, time=time).answer(Resources(PLACE))
        assert len(found.problems) == problems


@pytest.mark.parametrize(
    ("origin", "along", "found"),
    [
        ((0.8, -0.8, 1.0), (-0.2, 0.3, -0.4), (0.5, -0.35, 0.4)),  # the floor is below, and nothing before it
        ((0.5, -0.5, 0.3), (-0.5, 0.5, 0.01), (0.145, -0.145, 0.4)),  # the side of a ball is before it
        ((0.8, -0.8, 1.0), (0.0, 0.0, 1.0), None),
        ((0.8, -0.8, 1.0), (1.0, 0.0, 0.0), None),
    ],
)
def test_a_way_point_is_where_a_click_passes_the_height_of_the_obstacle_or_meets_a_surface(
    origin: tuple[float, float, float], along: tuple[float, float, float], found: tuple[float, float, float] | None
) -> None:
    click = Click(o.PathPoint.NEXT, Ray(origin, along))
    assert WayPointQuery(click, "box 1", 0.4).answer(Resources(PLACE)) == (
        None if found is None else pytest.approx(found, abs=0.05)
    )


def test_a_start_on_which_an_obstacle_is_at_take_off_is_a_sentence_and_a_goal_is_none(opened: Session) -> None:
    place = answered(with_obstacles(opened, BUS)).place
    assert place is not None
    there = End(BUS.entry.position)
    assert check_fit(place, EndRole.START, there).problem == "the start is where the obstacle 'bus' is at take-off."
    assert check_fit(place, EndRole.GOAL, there).problem is None


def test_none_is_dropped_on_a_robot_that_flies() -> None:
    result = PlacedObstaclesQuery((BOX,), robot_at=RigidState.at_rest(BOX.entry.position)).answer(Resources(PLACE))
    assert "'box 1' is where the robot flies" in result.problems["box 1"] and result.place.obstacles is None


def test_an_end_in_an_obstacle_is_a_sentence_with_the_nearest_free_point(opened: Session) -> None:
    place = answered(with_obstacles(opened, BOX)).place
    assert place is not None
    fit = check_fit(place, EndRole.GOAL, End((0.02, 0.6, 0.4)))
    assert fit.problem is not None and "the goal is where the obstacle 'box 1' stands" in fit.problem
    assert fit.offer is not None


def test_a_plan_is_asked_again_where_an_obstacle_was_placed(opened: Session) -> None:
    session = planned(replace(opened, place=PLACE))
    assert session.fresh_plan is not None
    moved = answered(replace(session, obstacles=(BOX,)))
    assert moved.plan_is_stale
    (asked,) = FollowingPlanQuery.pending(moved)
    assert asked.record.obstacles == moved.placed_obstacles and asked.record.draft, "it is to be seen at once"
    drafted = replace(moved, plan=asked.record)
    (judged,) = FollowingPlanQuery.pending(drafted)
    assert not judged.record.draft and judged.record.obstacles == moved.placed_obstacles


def test_while_a_hand_drags_the_plan_follows_before_the_obstacle_is_placed_again(opened: Session) -> None:
    session = planned(replace(opened, place=PLACE, obstacles=(BOX,)))
    session = after(session, o.ChangeObstacle("box 1", BOX.changed(position=(0.1, 0.6, 0.4)), held=True))
    assert isinstance(pending_queries(session)[0], PlacedObstaclesQuery)
    placed = answered(session)
    placed = after(placed, o.ChangeObstacle("box 1", BOX.changed(position=(0.2, 0.6, 0.4)), held=True))
    first, second = pending_queries(placed)[:2]
    assert isinstance(first, FollowingPlanQuery) and first.record.draft and isinstance(second, PlacedObstaclesQuery)


def test_a_place_that_was_opened_meanwhile_is_kept(opened: Session) -> None:
    (asked,) = PlacedObstaclesQuery.pending(with_obstacles(opened, BOX))
    other = replace(opened, place=balls_place(), obstacles=(BOX,))
    result = asked.answer(Resources(PLACE))
    assert isinstance(result, ObstaclesPlaced) and after(other, m.QueryAnswered(asked, result)).place is other.place


def test_an_obstacle_in_a_hand_is_in_no_map_until_it_is_put_down(opened: Session) -> None:
    session = planned(replace(opened, place=PLACE, obstacles=(BOX,)))
    for x in (0.1, 0.2):
        session = answered(after(session, o.ChangeObstacle("box 1", BOX.changed(position=(x, 0.6, 0.4)), held=True)))
        assert session.place is not None and session.place.field is PLACE.field
        assert session.place.movers is not None
        assert [held.position for held in session.place.movers.obstacles] == [(x, 0.6, 0.4)]
    session = answered(after(session, o.ChangeObstacle("box 1", BOX)))
    assert session.place is not None and session.place.movers is None and session.place.field is not PLACE.field


def test_a_planner_that_knows_no_movers_has_what_a_hand_holds_in_its_map(opened: Session) -> None:
    session = planned(replace(opened, place=PLACE, obstacles=(BOX,), choice=replace(opened.choice, planner="rrt")))
    session = answered(after(session, o.ChangeObstacle("box 1", BOX, held=True)))
    assert session.place is not None and session.place.movers is None and session.place.field is not PLACE.field


def test_a_draft_gives_way_to_an_obstacle_in_a_hand_and_in_the_map(opened: Session) -> None:
    session = replace(opened, place=PLACE)
    first = make_plan(plan_request(session.new_plan(session.ends), Resources(PLACE)), PLACE).steps[-1].motion
    x, y, z = first.states.position[first.states.position[:, 0].abs().argmin()].tolist()
    box = BOX.changed(position=(x, y, z))
    touched = Movers((box.obstacle,)).least_gaps(first.states, first.dt, PLACE.robot.body, 0.0).min()
    assert touched < 0
    for held in (True, False):
        placed = answered(replace(session, obstacles=(box,), in_hand="box 1", held=held)).place
        assert placed is not None and (placed.movers is not None) == held
        record = replace(session.new_plan(session.ends), draft=True)
        answer = FollowingPlanQuery(record, session.choice.robot, last=first).answer(Resources(placed))
        assert answer.steps, answer.refusal
        found = answer.steps[-1].motion
        assert Movers((box.obstacle,)).least_gaps(found.states, found.dt, PLACE.robot.body, 0.0).min() > 0


def test_an_obstacle_that_is_not_announced_is_in_no_map_and_only_for_a_robot_that_looks_for_it(opened: Session) -> None:
    unseen = BOX.changed(seen=True)
    session = answered(replace(opened, place=PLACE, obstacles=(unseen,)))
    assert session.place is not None and session.place.field is PLACE.field
    assert session.place.movers is not None and session.place.announced_movers is None
    assert plan_request(session.new_plan(session.ends), Resources(session.place)).watch
    flown = RigidState.at_rest((0.0, -0.6, 0.4))
    dropped = PlacedObstaclesQuery((unseen,), robot_at=flown).answer(Resources(PLACE))
    assert "is not announced, and this robot does not look for such" in dropped.problems["box 1"]
    assert not PlacedObstaclesQuery((unseen,), robot_at=flown).answer(Resources(session.place)).problems
