"""Starts and goals that cannot be planned between, and what is said about them."""

import pytest
import torch

from nerfnav import robots
from nerfnav.core.errors import InvalidInputError, OccupiedError, OutsideBoxError
from nerfnav.geometry import so3
from nerfnav.planner.objective.problem import PlanProblem
from nerfnav.planner.solvers.fast import plan_fast
from nerfnav.planner.space.ends import check_ends, fits, nearest_free_pose
from nerfnav.planner.space.occupancy import OccupancyConfig, OccupancyMap, body_density
from nerfnav.robots.state import RigidState
from tests.planner.places import ROBOT, Fog, Wall, ball

FIELD = ball()
MAP = OccupancyMap.of(FIELD, ROBOT.body, OccupancyConfig(voxel=0.05))
FREE = RigidState.at_rest((-0.7, 0, 0.4))


def check(start: RigidState, goal: RigidState) -> None:
    check_ends(FIELD, ROBOT.body, start, goal, MAP)


def test_free_ends_are_accepted():
    check(FREE, RigidState.at_rest((0.7, 0.1, 0.4), 2.0))


def test_a_goal_inside_a_stone_is_refused_with_the_nearest_free_point():
    with pytest.raises(OccupiedError, match=r"goal \(0.10, 0.00, 0.40\) is in occupied space; the nearest") as raised:
        check(FREE, RigidState.at_rest((0.1, 0.0, 0.4)))
    nearest = raised.value.nearest
    assert nearest is not None
    assert "(" + ", ".join(f"{number:.2f}" for number in nearest) + ")" in str(raised.value)
    check(FREE, RigidState.at_rest(nearest))  # what is offered is accepted
    assert torch.tensor(nearest).sub(torch.tensor([0.1, 0.0, 0.4])).norm() < 0.35


def test_a_start_beside_a_stone_is_judged_by_its_body_not_by_its_centre():
    beside = RigidState.at_rest((0.28, 0.0, 0.4))
    assert FIELD.density(beside.position) < 15 and body_density(FIELD, ROBOT.body, beside) > 100
    with pytest.raises(OccupiedError, match="the start"):
        check(beside, FREE)
    assert fits(FIELD, ROBOT.body, FREE) and not fits(FIELD, ROBOT.body, beside)
    density = body_density(FIELD, ROBOT.body, beside)
    assert fits(FIELD, ROBOT.body, beside, density) and not fits(FIELD, ROBOT.body, beside, 0.99 * density)


def test_ends_outside_the_box_are_refused_with_the_box_in_the_message():
    with pytest.raises(OutsideBoxError, match=r"the start \(0.00, 5.00, 0.40\) is outside .* x -1.00 to 1.00"):
        check(RigidState.at_rest((0, 5, 0.4)), FREE)


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
@pytest.mark.parametrize("part", ["position", "velocity", "rotation", "body_rate"])
def test_numbers_that_are_none_are_refused(part: str, bad: float):
    broken = RigidState.at_rest((0.7, 0, 0.4)).map(torch.clone)
    getattr(broken, part).view(-1)[1] = bad
    with pytest.raises(InvalidInputError, match=f"{part.replace('_', ' ')} of the goal must be finite"):
        check(FREE, broken)


def test_where_all_is_occupied_no_point_is_offered():
    stone = Fog(rho=100.0)
    occupancy = OccupancyMap.of(stone, ROBOT.body, OccupancyConfig(voxel=0.1))
    with pytest.raises(OccupiedError, match="no free point was found within 1 m") as raised:
        check_ends(stone, ROBOT.body, FREE, FREE, occupancy)
    assert raised.value.nearest is None


def test_the_nearest_free_point_is_in_whole_centimetres():
    nearest = nearest_free_pose(FIELD, ROBOT.body, RigidState.at_rest((0.0, 0.03, 0.4)), MAP)
    assert nearest is not None
    torch.testing.assert_close((nearest.position * 100).round() / 100, nearest.position)


def test_a_long_body_across_a_corridor_is_advised_to_turn():
    couch = robots.load("couch")
    corridor = Wall(door=0.28, thickness=1.9)  # along x, as wide as the body is long, less its soft edges
    occupancy = OccupancyMap.of(corridor, couch.body, OccupancyConfig(voxel=0.04), 0.4)
    across = RigidState.at_rest((0.0, 0.5, 0.4), torch.pi / 2)
    pose = nearest_free_pose(corridor, couch.body, across, occupancy)
    assert pose is not None and pose.position[2] == across.position[2]
    assert body_density(corridor, couch.body, pose) <= occupancy.scales.threshold
    assert torch.sin(so3.yaw_of(pose.rotation)).abs() < 0.5
    with pytest.raises(OccupiedError, match=r"the nearest free pose is .* with a heading of -?\d\.\d\d rad"):
        check_ends(corridor, couch.body, across, across, occupancy)


def test_a_robot_s_own_reasons_come_before_any_plan():
    couch = robots.load("couch")
    high = PlanProblem(FIELD, couch, FREE, RigidState.at_rest((0.7, 0.1, 0.6)))
    with pytest.raises(InvalidInputError):
        next(plan_fast(high))
