"""Obstacles of the configuration space: as large as the thing and the body, whatever their sizes."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.field.core.occupancy import raw_of
from nerfnav.field.models.voxel import VoxelField
from nerfnav.geometry import node_positions
from nerfnav.geometry.box import Box
from nerfnav.planner.kernels.terms import interpolate_chance
from nerfnav.planner.risk.collision_map import CollisionMap
from nerfnav.planner.risk.configuration_space import CSpace
from nerfnav.planner.risk.tracking_error import RiskContext
from nerfnav.planner.space.occupancy import OccupancyConfig, OccupancyMap
from nerfnav.robots import Body, NoiseModel, StateNoise, load
from nerfnav.robots.quadrotor import Quadrotor
from nerfnav.robots.quadrotor_config import QuadrotorConfig
from tests.planner.places import ROBOT

GRAIN = 0.015
"""Distance of the field's nodes [m]."""
LONG = Body.box((0.3, 0.1, 0.1), (9, 3, 3))
PUSHED = RiskContext(noise=NoiseModel(StateNoise(0.02, 0.0, 0.0, 0.0), StateNoise(0.0, 0.0, 0.0, 0.0)))


def block(half: tuple[float, float, float], scale: float = 1.0, solid: float = 5.0) -> VoxelField:
    """A block amid an empty box of 1.2 x 1.2 x 0.9 m, all of it `scale` times as large, `solid` [1/m] on its sides."""
    box = Box.of((-0.6 * scale, -0.6 * scale, -0.45 * scale), (0.6 * scale, 0.6 * scale, 0.45 * scale))
    shape = (round(1.2 / GRAIN) + 1, round(1.2 / GRAIN) + 1, round(0.9 / GRAIN) + 1)
    outside = (node_positions(box, shape).abs() - scale * torch.tensor(half)).amax(-1)  # in metres, 0 on its sides
    raw = raw_of(solid) - (200 * outside / scale).clamp(-20, 20)
    return VoxelField(box, torch.cat([raw[..., None], torch.full((*shape, 3), 0.5)], -1), torch.ones(3))


def blocked(space: CSpace) -> np.ndarray:
    """Where the body's centre cannot be, with any heading."""
    return np.logical_and.reduce(space.by_heading)


def widths(space: CSpace) -> np.ndarray:
    """Size of the obstacle along each axis [m], through its middle."""
    middle = np.round(-space.lower / space.spacing).astype(int)
    rows = [blocked(space).take(middle[a], axis=a) for a in range(3)]
    along = (rows[1][:, middle[2]], rows[0][:, middle[2]], rows[0][middle[1]])
    return space.spacing * [row.sum() for row in along]


@pytest.mark.parametrize("scale", [0.1, 1.0, 10.0])
@pytest.mark.parametrize("half", [(0.2, 0.1, 0.15), (0.213, 0.107, 0.158)])
def test_an_obstacle_is_as_large_as_the_thing_and_the_body(half: tuple[float, float, float], scale: float):
    extents = tuple(scale * edge for edge in ROBOT.body.extents)
    body = Body.box(extents, (5, 5, 3))
    space = CSpace.of(block(half, scale, OccupancyConfig().scales(block(half, scale), body).threshold), body)
    wanted = 2 * scale * np.array(half) + extents
    np.testing.assert_array_less(np.abs(widths(space) - wanted), 1.01 * space.spacing)
    assert space.spacing.max() < 0.13 * extents[0] + 1e-9


def test_maps_to_search_on_add_to_it_what_this_does_not():
    field = block((0.2, 0.1, 0.15))
    to_search = OccupancyMap.of(field, ROBOT.body)
    searched = to_search.dense.sum() * to_search.spacing.prod()
    space = CSpace.of(field, ROBOT.body)
    exactly = np.prod(2 * np.array([0.2, 0.1, 0.15]) + ROBOT.body.extents)
    assert blocked(space).sum() * space.spacing.prod() == pytest.approx(exactly, rel=0.08)
    assert searched > 1.2 * exactly


def test_where_points_would_be_further_apart_than_nodes_nothing_is_missed():
    box = Box.of((-300, -300, -10), (300, 300, 10))
    nodes = node_positions(box, (401, 401, 15))
    sheet = nodes[..., 0].abs() < 0.1  # a wall of a single node
    raw = torch.where(sheet, 10.0, -20.0)[..., None]
    field = VoxelField(box, torch.cat([raw, torch.full((*raw.shape[:3], 3), 0.5)], -1), torch.ones(3))
    space = CSpace.of(field, ROBOT.body)
    assert blocked(space).any(0).all() and space.spacing.min() > 1.0


def test_a_robot_that_never_leaves_its_height_has_obstacles_there_alone():
    field, body = block((0.2, 0.1, 0.15)), load("diffdrive").body
    space = CSpace.of(field, body, 0.0)
    assert blocked(space).shape[2] == 1 and space.lower[2] == 0.0
    assert not blocked(CSpace.of(field, body, 0.3)).any()
    side = 0.2 + 0.5 * body.extents[0]  # whatever its heading
    x = np.abs(space.lower[0] + np.arange(len(blocked(space))) * space.spacing[0])
    row = blocked(space)[:, round(-space.lower[1] / space.spacing[1]), 0]
    assert row[x < side - 0.015].all() and not row[x > side + 0.015].any()


def test_a_long_body_is_blocked_where_it_fits_with_no_heading():
    space = CSpace.of(block((0.2, 0.1, 0.15)), LONG)
    np.testing.assert_allclose(widths(space)[:2], [0.4 + 0.1, 0.2 + 0.1], atol=0.03)


@pytest.mark.parametrize("scale", [0.1, 1.0, 10.0])
def test_with_each_heading_a_long_body_has_obstacles_as_large_as_the_thing_and_the_body(scale: float):
    body = Body.box(tuple(scale * edge for edge in LONG.extents), (9, 3, 3))
    half = (0.2, 0.1, 0.15)
    space = CSpace.of(block(half, scale, OccupancyConfig().scales(block(half, scale), body).threshold), body)
    headings = len(space.by_heading)
    assert headings >= 4 and headings % 2 == 0
    for turn, extents in ((0, (0.3, 0.1, 0.1)), (headings // 2, (0.1, 0.3, 0.1))):  # along x, along y
        turned = replace(space, by_heading=space.by_heading[turn : turn + 1])
        wanted = scale * (2 * np.array(half) + extents)
        np.testing.assert_array_less(np.abs(widths(turned) - wanted), 1.01 * space.spacing)


def test_the_chance_of_a_long_body_goes_by_its_heading():
    """Beside a wall it is less likely to be pushed into it along it than across it."""
    robot = load("couch")
    chances = CollisionMap.of(block((0.2, 0.4, 0.4)), robot, replace(PUSHED, height=0.0))
    wall = 0.2  # its surface, along y
    for gap, heading in ((0.08, math.pi / 2), (0.18, 0.0)):  # from the middle: half of the body, and 3 cm
        found = interpolate_chance(chances.grid(PUSHED), 9, wall + gap, 0.0, 0.0, heading)[0]
        assert found == pytest.approx(0.5 * math.erfc(0.03 / 0.04 / math.sqrt(2)), abs=0.05)
    across, along = (
        interpolate_chance(chances.grid(PUSHED), 9, wall + 0.1, 0.0, 0.0, heading)[0] for heading in (0.0, math.pi / 2)
    )
    assert across > 0.8 and along < 0.2
    turned = [
        interpolate_chance(chances.grid(PUSHED), 9, wall + 0.1, 0.0, 0.0, math.pi / 2 + turn)[0]
        for turn in (math.pi, -math.tau)
    ]
    assert turned == pytest.approx([along, along])


@pytest.mark.parametrize("name", ["quadrotor", "quadrotor25"])
def test_the_chance_beside_a_block_is_the_tail_of_the_noise(name: str):
    robot = load(name)
    chances = CollisionMap.of(block((0.2, 0.2, 0.3)), robot, PUSHED)
    middle = np.round(-chances.lower * chances.per_meter).astype(int)
    row = chances.chances[-1, 0, :, middle[1], middle[2]]
    x = chances.lower[0] + np.arange(len(row)) / chances.per_meter[0]
    edge = 0.2 + 0.5 * robot.body.extents[0]
    tail = [0.5 * math.erfc((at - edge) / 0.04 / math.sqrt(2)) for at in x[(x > 0) & (x < 0.6)]]
    np.testing.assert_allclose(row[(x > 0) & (x < 0.6)], tail, atol=0.08)


def test_without_noise_the_chance_is_1_where_the_body_does_not_fit_and_0_elsewhere():
    still = StateNoise(0.0, 0.0, 0.0, 0.0)
    chances = CollisionMap.of(block((0.2, 0.1, 0.15)), ROBOT, RiskContext(noise=NoiseModel(still, still)))
    assert set(np.unique(chances.chances)) <= {0.0, 0.5, 1.0}
    volume = chances.chances[-1].sum() / chances.per_meter.prod()
    assert volume == pytest.approx(np.prod(2 * np.array([0.2, 0.1, 0.15]) + ROBOT.body.extents), rel=0.08)


def test_obstacles_that_the_memory_cannot_hold_are_refused(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("nerfnav.core.memory.available_memory", lambda: 10**6)
    with pytest.raises(InvalidInputError, match=r"^the chance that noise .* may take .* GB, .*: plan without risk"):
        CSpace.of(block((0.2, 0.1, 0.15)), ROBOT.body)


def test_chances_with_many_headings_that_the_memory_cannot_hold_are_refused(monkeypatch: pytest.MonkeyPatch):
    field = block((0.2, 0.1, 0.15))
    plank = Quadrotor(QuadrotorConfig(extents=(0.3, 0.1, 0.04), point_counts=(7, 5, 2)))
    space = CSpace.of(field, plank.body)
    monkeypatch.setattr("nerfnav.planner.risk.collision_map.CSpace.of", lambda *_: space)
    monkeypatch.setattr("nerfnav.core.memory.available_memory", lambda: 10**6)
    with pytest.raises(InvalidInputError, match=r"^the chance that noise .* headings, may take .*: plan without risk"):
        CollisionMap.of(field, plank, PUSHED)


def test_a_rod_thinner_than_the_nodes_are_apart_covers_them_with_any_heading():
    rod = Body.box((0.4, 0.008, 0.008), (41, 2, 2))
    space = CSpace.of(block((0.1, 0.1, 0.1)), rod)
    sizes = space.by_heading.sum((1, 2, 3))
    assert sizes.min() > 0.5 * sizes.max()


def test_the_clearance_is_the_distance_to_the_obstacle_or_to_the_border_and_is_measured_no_further_than_asked() -> None:
    space = CSpace.of(block((0.2, 0.1, 0.15)), ROBOT.body)
    face = 0.2 + 0.5 * ROBOT.body.extents[0]
    for away in (0.03, 0.1):
        measured = space.clearance(np.array([[face + away, 0.0, 0.0]]), 0.3)
        assert measured == pytest.approx(away, abs=1.5 * GRAIN)
    assert space.clearance(np.array([[face + 0.1, 0.0, 0.0]]), 0.05) == 0.05
    assert space.clearance(np.array([[0.58, 0.55, 0.4]]), 0.3) == pytest.approx(0.02, abs=GRAIN)
    path = np.array([[0.0, 0.4, 0.0], [0.0, 0.25, 0.0]])
    assert space.clearance(path, 0.3) == space.clearance(path[1:], 0.3) < space.clearance(path[:1], 0.3)
    for nowhere in ([0.0, 0.0, 0.0], [9.0, 0.0, 0.0], [math.nan, 0.0, 0.0]):
        assert space.clearance(np.array([nowhere]), 0.3) < 1e-6


def test_places_are_blocked_as_the_nearest_nodes_are_and_beyond_the_border() -> None:
    space = CSpace.of(block((0.2, 0.1, 0.15)), ROBOT.body)
    face = 0.2 + 0.5 * ROBOT.body.extents[0]
    free, solid = [face + 1.5 * GRAIN, 0.0, 0.0], [face - 1.5 * GRAIN, 0.0, 0.0]
    beyond, unknown = [0.7, 0.0, 0.0], [math.nan, 0.0, 0.0]
    assert space.blocks(np.array([[free, solid], [beyond, unknown]])).tolist() == [[False, True], [True, True]]
