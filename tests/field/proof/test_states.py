"""What planners believe of each voxel."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.field.core.occupancy import EMPTY_RAW, Occupancy, UnknownSpace, classify_unseen, planning_field
from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.proof.occupancy_grid import compute_occupancy_grid
from nerfnav.geometry.box import Box
from nerfnav.geometry.grid import node_positions
from tests.field.fields import ball

THRESHOLD = 5.0
FREE, SOLID, UNPROVEN = Occupancy


@pytest.fixture(scope="module")
def room() -> VoxelField:
    """2 x 1.6 x 1 m at 5 cm: a solid block, and beside it a block that no camera saw."""
    box = Box.of((-1.0, -0.6, 0.2), (1.0, 1.0, 1.2))
    nodes = node_positions(box, (41, 33, 21))
    solid = ((nodes - torch.tensor([-0.5, 0.2, 0.7])).abs() < torch.tensor([0.21, 0.31, 0.16])).all(-1)
    unseen = ((nodes - torch.tensor([0.5, 0.2, 0.7])).abs() < torch.tensor([0.21, 0.31, 0.16])).all(-1)
    values = torch.full((41, 33, 21, 4), EMPTY_RAW)
    values[..., 0][solid] = 1.0
    return VoxelField(box, values, torch.ones(3), evidence=classify_unseen(unseen, values[..., 0]))


def test_states_are_those_of_known_points(room: VoxelField):
    grid = compute_occupancy_grid(room, THRESHOLD)
    points = {
        (-0.5, 0.2, 0.7): SOLID,
        (-0.31, 0.48, 0.84): SOLID,
        (0.5, 0.2, 0.7): UNPROVEN,
        (0.31, -0.08, 0.56): UNPROVEN,
        (0.0, 0.2, 0.7): FREE,
        (-0.5, 0.2, 1.0): FREE,
        (0.5, 0.2, 0.4): FREE,
        (-0.99, -0.59, 0.21): FREE,
        (5.0, 0.0, 0.5): UNPROVEN,
    }
    assert grid.at(np.array(list(points))).tolist() == list(points.values())


def test_voxels_are_cubes_that_cover_the_box(room: VoxelField):
    for edge in (None, 0.03, 0.07):
        grid = compute_occupancy_grid(room, THRESHOLD, edge)
        assert grid.voxel == pytest.approx(edge or 0.05)
        assert np.allclose(grid.lower + 0.5 * grid.voxel, [-1.0, -0.6, 0.2]), "the middle of the first one"
        reach = grid.lower + grid.voxel * np.array(grid.state.shape)
        assert (reach > np.array([1.0, 1.0, 1.2]) - 1e-4).all()
        assert (reach < np.array([1.0, 1.0, 1.2]) + grid.voxel).all()


def test_voxels_as_large_as_the_distance_of_nodes_stand_around_them(room: VoxelField):
    state = compute_occupancy_grid(room, THRESHOLD).state
    assert np.array_equal(state == SOLID, (room.values[..., 0] > 0).numpy())
    assert room.unknown is not None and np.array_equal(state == UNPROVEN, room.unknown.numpy())


@pytest.mark.parametrize("edge", [0.05, 0.031, 0.08])
def test_nothing_that_planners_take_for_solid_is_called_free(room: VoxelField, edge: float):
    """At the middle of each voxel."""
    grid = compute_occupancy_grid(room, THRESHOLD, edge)
    middles = grid.lower + grid.voxel * (np.argwhere(grid.state == FREE) + 0.5)
    points = torch.from_numpy(np.minimum(middles, room.box.upper.double().numpy())).float()
    assert (planning_field(room, UnknownSpace.OCCUPIED).density(points) <= THRESHOLD).all()


def test_shares_are_those_of_the_voxels(room: VoxelField):
    grid = compute_occupancy_grid(room, THRESHOLD)
    assert grid.share(SOLID) == grid.share(UNPROVEN) == 9 * 13 * 7 / (41 * 33 * 21)
    assert sum(grid.share(state) for state in Occupancy) == pytest.approx(1.0)


def test_a_field_that_was_never_asked_what_is_unknown_has_nothing_unproven(room: VoxelField):
    grid = compute_occupancy_grid(replace(room, evidence=None), THRESHOLD)
    assert grid.share(UNPROVEN) == 0 < grid.share(SOLID)


def test_thin_things_are_found_wherever_the_voxels_fall(room: VoxelField):
    values = torch.full_like(room.values, EMPTY_RAW)
    values[20, 16, :, 0] = 1.0  # one column of nodes
    wire = replace(room, values=values, evidence=None)
    for edge in (0.05, 0.04, 0.03):
        layer = compute_occupancy_grid(wire, THRESHOLD, edge).layer(0.7)
        assert (layer == SOLID).any(), edge


def test_a_layer_is_that_of_a_height_and_others_are_refused(room: VoxelField):
    grid = compute_occupancy_grid(room, THRESHOLD)
    assert np.array_equal(grid.layer(0.70), grid.state[..., 10])
    assert np.array_equal(grid.layer(1.2), grid.state[..., -1])
    with pytest.raises(InvalidInputError, match=r"is 0\.175 to 1\.23 m high: there is no slice at 1\.5 m"):
        grid.layer(1.5)


def test_a_field_without_voxels_is_refused_and_so_is_a_grid_too_fine(room: VoxelField):
    with pytest.raises(InvalidInputError, match="bake this one first, with nerfnav bake"):
        compute_occupancy_grid(ball(), THRESHOLD)
    with pytest.raises(InvalidInputError, match="more than 100000000 of them: choose a larger voxel"):
        compute_occupancy_grid(room, THRESHOLD, 0.001)
