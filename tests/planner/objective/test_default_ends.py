"""Start and goal that nobody has put anywhere."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
import torch

from nerfnav.field.core.info import FieldInfo
from nerfnav.field.models.voxel import DENSITY_SCALE, EMPTY_RAW, VoxelField
from nerfnav.geometry.box import Box
from nerfnav.geometry.grid import node_positions, shape_for
from nerfnav.planner.objective.default_ends import Pair, path_between, propose_ends
from nerfnav.planner.space.ends import fits
from nerfnav.planner.space.occupancy import OccupancyConfig, OccupancyMap
from nerfnav.planner.space.regions import free_regions
from nerfnav.robots import PAPER_NOISE, Robot, load

_SOLID = 60.0 / DENSITY_SCALE
Corners = tuple[tuple[float, float, float], tuple[float, float, float]]


def field_of(box: Corners, *blocks: Corners, spacing: float = 0.02) -> VoxelField:
    """A field of `box` in which blocks are solid, and painted in squares of 20 cm, so that a camera sees them."""
    bounds = Box.of(*box)
    points = node_positions(bounds, shape_for(bounds, spacing))
    raw = torch.full(points.shape[:3], EMPTY_RAW)
    for lower, upper in blocks:
        raw[((points >= torch.tensor(lower)) & (points <= torch.tensor(upper))).all(-1)] = _SOLID
    paint = torch.rand(4096, 3, generator=torch.Generator().manual_seed(0))
    squares = (((points - bounds.lower) / 0.2).long() * torch.tensor([1, 37, 1369])).sum(-1) % len(paint)
    values = torch.cat([raw[..., None], paint[squares]], -1)
    return VoxelField(bounds, values, torch.ones(3), FieldInfo(source="a test"))


def found_in(field: VoxelField, robot: Robot) -> Pair | None:
    """What is found where the field is planned in as it was learned."""
    return propose_ends(field, field, robot, lambda height: map_of(field, robot, height))


def map_of(field: VoxelField, robot: Robot, height: float) -> OccupancyMap:
    return OccupancyMap.of(field, robot.body, OccupancyConfig(), height if robot.planar else None)


_HALL: Corners = ((-1.5, -1.0, 0.0), (1.5, 1.0, 0.8))
_FLOOR: Corners = ((-2.0, -2.0, -1.0), (2.0, 2.0, 0.1))
_PILLAR: Corners = ((-0.2, -0.3, 0.0), (0.2, 0.3, 0.8))


@pytest.mark.parametrize("name", ["quadrotor", "couch", "diffdrive"])
def test_the_robot_fits_at_both_ends_and_a_way_between_them_is_found(name: str) -> None:
    field, robot = field_of(_HALL, _FLOOR, _PILLAR), load(name)
    pair = found_in(field, robot)
    assert pair is not None
    start, goal = pair
    assert fits(field, robot.body, start) and fits(field, robot.body, goal)
    assert path_between(map_of(field, robot, start.position[2].item()), pair) is not None
    length, apart = max(robot.body.extents[:2]), (goal.position - start.position).norm().item()
    assert 3 * length <= apart < 25 * length


@pytest.mark.parametrize("name", ["couch", "diffdrive"])
def test_a_robot_on_the_ground_stands_on_the_floor_and_not_in_the_air(name: str) -> None:
    pair = found_in(field_of(_HALL, _FLOOR, _PILLAR), load(name))
    assert pair is not None
    bottom = pair[0].position[2].item() - 0.5 * load(name).body.extents[2]
    assert pair[0].position[2] == pair[1].position[2]
    assert 0.1 < bottom < 0.1 + 5 * 0.02


def test_without_a_floor_a_cart_goes_nowhere_and_a_quadrotor_flies() -> None:
    field = field_of(_HALL, _PILLAR)
    assert found_in(field, load("diffdrive")) is None
    assert found_in(field, load("quadrotor")) is not None


def test_both_ends_are_in_the_larger_of_two_closed_rooms() -> None:
    wall: Corners = ((-0.6, -2.0, -1.0), (-0.45, 2.0, 2.0))
    pair = found_in(field_of(_HALL, wall), load("quadrotor"))
    assert pair is not None and all(state.position[0] > -0.45 for state in pair)


def test_where_there_is_no_room_nothing_is_found() -> None:
    assert found_in(field_of(_HALL, ((-2, -2, -1), (2, 2, 2))), load("quadrotor")) is None
    assert found_in(field_of(((0, 0, 0), (0.25, 0.25, 0.25)), spacing=0.01), load("quadrotor")) is None


def test_a_robot_looks_at_something_from_where_it_starts() -> None:
    pair = found_in(field_of(_HALL, _PILLAR), load("quadrotor"))
    assert pair is not None
    toward = -pair[0].position[:2] / pair[0].position[:2].norm()
    assert torch.dot(pair[0].rotation[:2, 0], toward) > 0.5


def test_the_same_place_gives_the_same_ends() -> None:
    one, other = (found_in(field_of(_HALL, _FLOOR, _PILLAR), load("quadrotor")) for _ in range(2))
    assert one is not None and other is not None
    assert all(torch.equal(a.position, b.position) for a, b in zip(one, other, strict=True))


def test_roomier_regions_come_first_and_lie_in_the_others() -> None:
    occupancy = map_of(field_of(_HALL, _FLOOR, _PILLAR), load("quadrotor"), 0.0)
    regions = list(free_regions(occupancy))
    assert len(regions) == 3
    for roomier, other in itertools.pairwise(regions):
        assert roomier.inside.sum() < other.inside.sum() and not np.any(roomier.inside & ~other.inside)
    assert not np.any(regions[-1].inside & occupancy.occupied.numpy())


def test_ends_keep_clear_of_what_noise_pushes_a_robot_into_where_there_is_room() -> None:
    field, robot = field_of(_HALL, _FLOOR, _PILLAR), load("quadrotor")
    pair = found_in(field, robot)
    assert pair is not None
    push = 3 * PAPER_NOISE.process.position_m
    for end in pair:
        for away in torch.cat([push * torch.eye(3), -push * torch.eye(3)]):
            assert fits(field, robot.body, replace(end, position=end.position + away))
