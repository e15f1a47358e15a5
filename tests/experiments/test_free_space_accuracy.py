"""The figures that say whether plans can be trusted: what planners take for free, against what is."""

from dataclasses import replace

import pytest
import torch

from nerfnav.experiments.free_space_accuracy import (
    FreeSpaceAccuracy,
    FreeSpaceConfig,
    describe_free_space_accuracy,
    measure_free_space_on_depth,
    measure_free_space_on_mesh,
    measure_unproven_share,
    note_free_space,
)
from nerfnav.field.core.info import FieldInfo
from nerfnav.field.core.occupancy import EMPTY_RAW, Occupancy, classify_nodes
from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.proof.fusion import fuse_depth
from nerfnav.geometry.images import PosedImages
from tests.field import rooms

CONFIG = FreeSpaceConfig(surface_points=1500, free_points=3000)


@pytest.fixture(scope="module")
def taken() -> PosedImages:
    return rooms.photographs()


@pytest.fixture(scope="module")
def proven(taken: PosedImages) -> VoxelField:
    """What depth tells of the room."""
    depth = fuse_depth(taken, rooms.BOX, rooms.SHAPE)
    raw = torch.where(depth.known, depth.raw, EMPTY_RAW)
    values = torch.cat([raw[..., None], depth.color], -1)
    return VoxelField(rooms.BOX, values, torch.zeros(3), evidence=classify_nodes(depth.free, raw))


def test_a_field_that_knows_its_walls_takes_none_for_free_and_the_air_for_free(proven: VoxelField, taken: PosedImages):
    found = measure_free_space_on_mesh(proven, rooms.VOXEL, rooms.room(), *rooms.cameras(taken), CONFIG)
    assert found.surface_taken_for_free == pytest.approx(0, abs=0.01)
    assert found.free_taken_for_free == pytest.approx(1, abs=0.05)
    assert found.unproven_share is not None and 0.2 < found.unproven_share < 0.6  # what lies behind the walls


def test_a_field_without_its_plain_wall_is_found_out(taken: PosedImages):
    blind = rooms.field_without_the_plain_wall()
    found = measure_free_space_on_mesh(blind, rooms.VOXEL, rooms.room(), *rooms.cameras(taken), CONFIG)
    assert found.surface_taken_for_free is not None
    assert found.surface_taken_for_free > 0.1  # a sixth of the walls, but for its border
    assert found.unproven_share is None


def test_space_that_nothing_proves_is_not_taken_for_free(proven: VoxelField, taken: PosedImages):
    shut = replace(proven, evidence=torch.full(rooms.SHAPE, int(Occupancy.UNPROVEN), dtype=torch.uint8))
    found = measure_free_space_on_mesh(shut, rooms.VOXEL, rooms.room(), *rooms.cameras(taken), CONFIG)
    assert (found.surface_taken_for_free, found.free_taken_for_free, found.unproven_share) == (0, 0, 1)


@pytest.mark.slow
def test_held_out_depth_tells_the_same_as_the_mesh(proven: VoxelField, taken: PosedImages):
    others, held_out = taken.subset(slice(0, 80)), taken.subset(slice(80, 90))
    found = measure_free_space_on_depth(proven, rooms.VOXEL, held_out, others, CONFIG)
    assert found.surface_taken_for_free == pytest.approx(0, abs=0.01)
    assert found.free_taken_for_free == pytest.approx(1, abs=0.05)
    blind = measure_free_space_on_depth(rooms.field_without_the_plain_wall(), rooms.VOXEL, held_out, others, CONFIG)
    assert blind.surface_taken_for_free is not None and blind.surface_taken_for_free > 0.05


def test_a_field_alone_tells_only_how_much_is_unproven(proven: VoxelField):
    found = measure_unproven_share(proven, rooms.VOXEL)
    assert found.surface_taken_for_free is None and found.unproven_share is not None
    assert measure_unproven_share(replace(proven, evidence=None), rooms.VOXEL) == FreeSpaceAccuracy(
        None, None, None, rooms.VOXEL
    )


def test_figures_are_noted_and_told_in_words():
    found = FreeSpaceAccuracy(0.012, 0.9, 0.33, 0.05)
    noted = note_free_space(FieldInfo(), found)
    assert (noted.surface_taken_for_free, noted.free_taken_for_free, noted.unproven_share) == (0.012, 0.9, 0.33)
    assert describe_free_space_accuracy(found) == (
        "planners take 1.2% of the true surface for free and 90.0% of the space that is free; "
        "33% of the box is unproven and counts as solid"
    )
    assert "nothing proves" in describe_free_space_accuracy(FreeSpaceAccuracy(None, None, None, 0.05))
