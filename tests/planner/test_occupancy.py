"""Where a body fits."""

import numpy as np
import pytest
import torch

from nerfnav.planner.space.occupancy import OccupancyConfig, OccupancyMap, body_density
from nerfnav.robots.body import Body
from nerfnav.robots.state import RigidState
from tests.planner.places import BOX, ROBOT, Fog, Wall, ball

COARSE = OccupancyConfig(voxel=0.05)
INSIDE = (slice(2, -2), slice(2, -2), slice(2, -2))
"""Voxels from which a body does not reach beyond the border."""


def test_a_voxel_is_occupied_where_the_body_would_touch():
    occupancy = OccupancyMap.of(ball(), ROBOT.body, COARSE)
    index = torch.stack(torch.meshgrid(*(torch.arange(n) for n in occupancy.occupied.shape), indexing="ij"), -1)
    centers = occupancy.centers(index.reshape(-1, 3))
    touching = [body_density(ball(), ROBOT.body, RigidState.at_rest(tuple(c.tolist()))) > 5 for c in centers[::97]]
    found = occupancy.occupied.flatten()[::97]
    assert sum(touching) > 3
    assert found[torch.tensor(touching)].all()  # no touching body is overlooked ...
    assert found.sum() <= 1.6 * sum(touching) + 5  # ... and little is occupied beyond that
    # the level body is thinner than it is wide
    above, beside = occupancy.index(torch.tensor([0, 0, 0.75])), occupancy.index(torch.tensor([0.3, 0, 0.4]))
    assert not occupancy.occupied[tuple(above)] and occupancy.occupied[tuple(beside)]


def test_a_larger_body_finds_less_room():
    small, large = (OccupancyMap.of(ball(), Body.box((s, s, s), (2, 2, 2)), COARSE) for s in (0.05, 0.3))
    assert (large.occupied | ~small.occupied).all()
    assert large.occupied.sum() > 2 * small.occupied.sum()


@pytest.mark.parametrize(("rho", "occupied"), [(0.5, False), (50.0, True)])
def test_fog_is_free_and_stone_is_not(rho: float, occupied: bool):
    assert (OccupancyMap.of(Fog(rho=rho), ROBOT.body, COARSE).occupied[INSIDE] == occupied).all()


def test_space_costs_more_near_a_wall_and_priceless_inside():
    occupancy = OccupancyMap.of(Wall(door=0.0), ROBOT.body, COARSE)
    line = occupancy.prices[0, 2:-2, 10, 10]  # where no body reaches beyond the border
    assert np.isinf(line[len(line) // 2])
    assert line[0] == 1
    free = line[: len(line) // 2][np.isfinite(line[: len(line) // 2])]
    assert free[-1] > free[0] and (np.diff(free) >= 0).all()


def test_an_empty_field_costs_the_same_everywhere_inside():
    prices = OccupancyMap.of(Fog(rho=0.0), ROBOT.body, COARSE).prices[0]
    assert (prices[INSIDE] == 1).all() and np.isinf(prices[0]).all()


def test_nearest_free_voxels_come_in_order_and_within_reach():
    occupancy = OccupancyMap.of(ball(), ROBOT.body, COARSE)
    point = torch.tensor([0.1, 0.0, 0.4])
    centers = occupancy.nearest_free_voxels(point, 0.5)
    distance = (centers - point).norm(dim=-1)
    assert len(centers) > 10
    assert (distance.diff() >= -1e-6).all() and distance[-1] <= 0.5 + 1e-6
    assert not any(occupancy.occupied[tuple(occupancy.index(c))] for c in centers)
    assert len(occupancy.nearest_free_voxels(point, 0.05)) == 0


def test_a_search_that_reaches_over_the_border_stays_in_the_box():
    occupancy = OccupancyMap.of(ball(), ROBOT.body, COARSE)
    assert BOX.contains(occupancy.nearest_free_voxels(torch.tensor([1.1, -1.0, 0.0]), 0.3)).all()


def test_a_long_body_has_a_map_for_each_heading_and_fits_a_narrow_door_only_along_it():
    long = Body.box((0.4, 0.1, 0.1), (9, 3, 3))
    occupancy = OccupancyMap.of(Wall(door=0.3, thickness=0.05), long, OccupancyConfig())
    door = occupancy.index(torch.tensor([0.0, 0.5, 0.4]))
    by_heading = [bool(occupied[tuple(door)]) for occupied in occupancy.by_heading]
    assert by_heading[0] is False and by_heading[len(by_heading) // 2] is True
    assert not occupancy.occupied[tuple(door)]
    assert len(OccupancyMap.of(ball(), ROBOT.body, COARSE).by_heading) == 1


def test_a_map_of_one_height_has_that_height_exactly():
    low, high = (OccupancyMap.of(ball(), ROBOT.body, COARSE, height) for height in (0.37, 0.9))
    middle = low.index(torch.tensor([0.0, 0.0, 0.37]))
    assert low.occupied.shape[-1] == 1 and middle[2] == 0
    assert low.occupied[tuple(middle)] and not high.occupied[2:-2, 2:-2].any()
    assert low.centers(torch.from_numpy(middle)[None])[0, 2] == pytest.approx(0.37)
