"""Ends of robots on the ground: they stand on a floor that carries the whole footprint, or are refused."""

import math

import pytest
import torch

import nerfnav_scenes as scenes
from nerfnav.field import Field, UnknownSpace, load_field, planning_field
from nerfnav.field.edit.crop import crop_field
from nerfnav.field.models.analytic import BallsField
from nerfnav.field.models.voxel import VoxelField
from nerfnav.geometry import Box
from nerfnav.planner import Footing, Support, close_holes, fits, settle_ends, settle_on_ground
from nerfnav.robots import RigidState, load
from tests.planner.grounds import FLOOR_M, TABLE_M, hall
from tests.planner.objective.test_default_ends import field_of

HALL = hall()
CART = load("diffdrive")
HALF = 0.5 * CART.body.extents[2]
VOXEL = 0.02


def stand(point: tuple[float, float, float], yaw: float = 0.0, field: Field = HALL) -> Support:
    return settle_on_ground(field, field, CART, RigidState.at_rest(point, yaw))


def settled(start: tuple[float, float, float], goal: tuple[float, float, float]) -> tuple[Support, Support]:
    return settle_ends(HALL, HALL, CART, RigidState.at_rest(start), RigidState.at_rest(goal))


@pytest.mark.parametrize("name", ["stonehenge", "church", "apartment"])
def test_no_end_of_a_bundled_task_moves_by_a_bit(name: str) -> None:
    field = load_field(scenes.trained_path(name))
    planning = planning_field(field, UnknownSpace.OCCUPIED)
    driven = [task for task in scenes.tasks_of(name) if load(task.robot).planar]
    assert driven
    for task in driven:
        ends = task.start_state, task.goal_state
        supports = settle_ends(field, planning, load(task.robot), *ends)
        assert [support.footing for support in supports] == [Footing.STANDS, Footing.STANDS], task.name
        assert all(
            torch.equal(support.state.position, end.position) for support, end in zip(supports, ends, strict=True)
        )


@pytest.mark.parametrize("height", [0.25, 0.6, 0.9])
@pytest.mark.parametrize("yaw", [0.0, 0.7, math.pi / 2])
def test_a_robot_in_the_air_drops_onto_the_floor_and_fits_there(height: float, yaw: float) -> None:
    support = stand((-0.3, -0.4, height), yaw)
    gap = support.state.position[2].item() - HALF - FLOOR_M
    assert support.footing is Footing.MOVED and 0 < gap <= 3.5 * VOXEL
    assert fits(HALL, CART.body, support.state)
    assert support.state.position[:2].tolist() == pytest.approx([-0.3, -0.4])
    assert stand(tuple(support.state.position.tolist()), yaw).footing is Footing.STANDS


def test_the_nearest_support_below_is_a_table_above_it_and_the_floor_beneath_it() -> None:
    assert stand((-1.0, 0.5, 0.9)).floor == pytest.approx(TABLE_M, abs=VOXEL)
    assert stand((-1.0, 0.5, 0.35)).floor == pytest.approx(FLOOR_M, abs=VOXEL)


def test_a_robot_with_its_underside_in_the_floor_is_raised_and_one_inside_of_something_is_not_judged() -> None:
    raised = stand((-0.3, -0.4, FLOOR_M + 0.02))
    assert raised.footing is Footing.MOVED and fits(HALL, CART.body, raised.state)
    assert stand((-0.3, -0.4, 0.05)).footing is Footing.NOT_JUDGED
    assert stand((9.0, 0.0, 0.2)).footing is Footing.NOT_JUDGED
    assert stand((math.nan, 0.0, 0.2)).footing is Footing.NOT_JUDGED


def test_above_a_hole_it_is_refused_with_the_depth_that_was_searched() -> None:
    support = stand((0.55, -0.4, 0.5))
    assert support.footing is Footing.IN_THE_AIR and support.depth == pytest.approx(0.5 - HALF)
    problem = support.problem("diffdrive", "start")
    assert problem is not None and "stand in the air at the start" in problem and "within 0.46 m" in problem
    assert "move the start onto the floor" in problem


@pytest.mark.parametrize("point", [(0.3, -0.4, 0.4), (-0.7, 0.6, 0.9)])
def test_half_of_it_over_an_edge_it_is_refused(point: tuple[float, float, float]) -> None:
    support = stand(point)
    assert support.footing is Footing.ON_AN_EDGE and 0.2 < support.share < 0.8
    problem = support.problem("diffdrive", "goal")
    assert problem is not None and f"{100 * support.share:.0f} %" in problem


def test_unproven_space_below_a_surface_does_not_matter_and_without_a_surface_is_no_floor() -> None:
    empty = BallsField(Box.of((-1, -1, 0), (1, 1, 1)), torch.zeros(1, 3) - 5.0, torch.ones(1) * 0.1)
    shell = hall(floor_from=0.06)  # nothing was learned of what is below
    state = RigidState.at_rest((-0.3, -0.4, 0.4))
    assert settle_on_ground(shell, HALL, CART, state).footing is Footing.MOVED
    assert settle_on_ground(empty, HALL, CART, state).footing is Footing.IN_THE_AIR, "planners take it for solid"


def test_both_ends_get_one_height_and_the_one_that_stands_keeps_its_own() -> None:
    standing = stand((-0.3, -0.4, 0.5)).state.position[2].item()
    start, goal = settled((-0.3, -0.4, standing + 0.005), (-1.2, -0.5, 0.8))
    assert start.footing is Footing.STANDS and goal.footing is Footing.MOVED
    assert torch.equal(start.state.position[2], goal.state.position[2])
    start, goal = settled((-0.3, -0.4, 0.8), (-1.2, -0.5, standing + 0.005))
    assert start.footing is Footing.MOVED and goal.footing is Footing.STANDS
    assert torch.equal(start.state.position[2], goal.state.position[2])


def test_a_goal_on_the_table_is_refused_from_the_floor() -> None:
    start, goal = settled((-0.3, -0.4, 0.5), (-1.0, 0.5, 0.9))
    assert start.footing is Footing.MOVED and goal.footing is Footing.OTHER_LEVEL
    problem = goal.problem("diffdrive", "goal")
    assert problem is not None and "move one of them" in problem and goal.other == start.floor


def cropped(lowest: float) -> VoxelField:
    """The hall as a box that is cut off at a height [m]."""
    field = crop_field(HALL, Box(torch.tensor([-1.5, -1.0, lowest]), HALL.box.upper))
    assert isinstance(field, VoxelField)
    return field


@pytest.mark.parametrize("lowest", [FLOOR_M - VOXEL, FLOOR_M, FLOOR_M + VOXEL])
def test_a_robot_stands_on_the_bottom_of_a_box_that_is_cropped_at_the_floor(lowest: float) -> None:
    standing = stand((-0.3, -0.4, 0.5)).state
    field = cropped(lowest)
    support = settle_on_ground(field, field, CART, standing)
    assert support.footing is Footing.STANDS and support.state is standing and fits(field, CART.body, standing)


def test_a_hole_is_closed_at_the_height_of_a_robot_that_drives_and_its_edge_is_not() -> None:
    height = stand((-0.3, -0.4, 0.5)).state.position[2].item()
    closed = close_holes(HALL, CART, height)
    for x, floor in ((0.25, True), (0.4, False), (0.7, False), (0.85, True)):
        point = torch.tensor([[x, -0.4, height]])
        assert (closed.density(point).item() < 1) is floor, x
        assert HALL.density(point).item() < 1
    assert not fits(closed, CART.body, RigidState.at_rest((0.55, -0.4, height)))
    beside = RigidState.at_rest((-0.3, -0.4, height))
    assert fits(closed, CART.body, beside) and closed.box == HALL.box


@pytest.mark.parametrize("floored", [cropped(FLOOR_M), field_of(((-1, -1, 0), (1, 1, 1)), ((-2, -2, -1), (2, 2, 0.1)))])
def test_a_floor_without_holes_and_a_robot_that_flies_leave_the_field_as_it_is(floored: VoxelField) -> None:
    assert close_holes(floored, CART, 0.17) is floored
    assert close_holes(HALL, load("quadrotor"), 0.17) is HALL


def test_a_robot_on_a_table_does_not_drive_over_its_edge() -> None:
    height = stand((-1.0, 0.5, 0.9)).state.position[2].item()
    closed = close_holes(HALL, CART, height)
    assert fits(closed, CART.body, RigidState.at_rest((-1.0, 0.6, height)))
    assert not fits(closed, CART.body, RigidState.at_rest((-0.4, 0.6, height)))


def test_robots_that_fly_stay_where_they_are() -> None:
    state = RigidState.at_rest((0.55, -0.4, 0.5))
    supports = settle_ends(HALL, HALL, load("quadrotor"), state, state)
    assert all(support.state is state and not support.footing.is_refused for support in supports)
