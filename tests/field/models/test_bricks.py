"""A field of bricks is the dense field that it was made of, in less memory."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from nerfnav.core.errors import FieldFileError, InvalidInputError
from nerfnav.field.core.occupancy import EMPTY_RAW, Occupancy, UnknownSpace, planning_field
from nerfnav.field.core.protocol import density_and_gradient
from nerfnav.field.models.bricks import BrickField, convert_to_bricks
from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.storage import grid_codec
from nerfnav.field.storage.checkpoint import load_field, save_field
from tests.field.fields import random_rays, random_voxels


@pytest.fixture(scope="module")
def dense() -> VoxelField:
    """Fog in half of a box, with all kinds of evidence; numbers of nodes that are no whole number of blocks."""
    field = random_voxels()
    field.values[:12, :, :, 0] = EMPTY_RAW
    states = torch.randint(0, 3, field.shape, generator=torch.Generator().manual_seed(1)).to(torch.uint8)
    states[:10, :12] = int(Occupancy.FREE)
    states[:10, 12:] = int(Occupancy.UNPROVEN)
    return replace(field, evidence=states)


@pytest.mark.parametrize("planned", [False, True])
def test_bricks_tell_just_what_the_dense_field_tells(dense: VoxelField, planned: bool):
    bricks = convert_to_bricks(dense)
    first, second = (planning_field(field, UnknownSpace.OCCUPIED) if planned else field for field in (dense, bricks))
    points = torch.rand(3000, 3, generator=torch.Generator().manual_seed(0)) * 3 - 1.5
    for one, other in zip(*(density_and_gradient(f, points.double().numpy()) for f in (first, second)), strict=True):
        np.testing.assert_array_equal(one, other)
    assert torch.equal(first.density(points), second.density(points))
    rays = random_rays(200)
    assert isinstance(first, VoxelField) and isinstance(second, BrickField)
    assert torch.equal(first.render_rays(*rays).color, second.render_rays(*rays).color)
    for one, other in zip(first.colors_and_jacobian(*rays), second.colors_and_jacobian(*rays), strict=True):
        # the dense field's kernel looks exponentials up in a table
        assert (one - other).abs().max() <= 2e-3 * other.abs().max()
    assert torch.equal(first.samples(*rays).distances, second.samples(*rays).distances)


def test_a_block_is_left_out_only_where_nothing_is_in_it(dense: VoxelField):
    bricks = convert_to_bricks(dense)
    assert dense.evidence is not None
    held = (dense.values[..., 0] > EMPTY_RAW) | (dense.evidence != Occupancy.FREE)
    for block in (bricks.slots == 0).nonzero().tolist():
        nodes = tuple(slice(4 * part, 4 * part + 5) for part in block)
        assert not held[nodes].any()
    assert (bricks.slots == 0).any()


def test_blocks_that_are_the_same_throughout_share_a_brick(dense: VoxelField):
    values = dense.values.clone()
    values[:13], values[:13, ..., 0] = 0.5, EMPTY_RAW
    bricks = convert_to_bricks(replace(dense, values=values))
    unproven = bricks.slots[:2, 4, :3]  # blocks of nodes 0 to 8, 16 to 20, 0 to 12, all unproven
    assert len(unproven.unique()) == 1 and (unproven > 0).all()


def test_a_field_of_bricks_is_kept_in_a_file(dense: VoxelField, tmp_path: Path):
    bricks, path = convert_to_bricks(dense), tmp_path / "bricks.npz"
    assert save_field(bricks, path) == path.stat().st_size
    loaded = load_field(path)
    assert isinstance(loaded, BrickField) and loaded.evidence is not None and bricks.evidence is not None
    assert loaded.shape == bricks.shape and torch.equal(loaded.slots, bricks.slots)
    assert torch.equal(loaded.evidence, bricks.evidence)
    assert (loaded.values[..., 0] - bricks.values[..., 0]).abs().max() <= 1 / 16 + 1e-6


def test_a_block_without_its_brick_is_no_whole_file(dense: VoxelField, tmp_path: Path):
    bricks = convert_to_bricks(dense)
    wrong = replace(bricks, slots=bricks.slots + len(bricks.values))
    save_field(wrong, tmp_path / "wrong.npz")
    with pytest.raises(FieldFileError, match="not a whole nerfnav field"):
        load_field(tmp_path / "wrong.npz")


def test_a_dense_file_of_very_many_nodes_is_read_as_bricks(
    dense: VoxelField, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    save_field(dense, tmp_path / "dense.npz")
    as_it_was = load_field(tmp_path / "dense.npz")
    monkeypatch.setattr(grid_codec, "MOST_DENSE_NODES", 1000)
    loaded = load_field(tmp_path / "dense.npz")
    assert isinstance(loaded, BrickField)
    points = torch.rand(2000, 3, generator=torch.Generator().manual_seed(0)) * 3 - 1.5
    planned = [planning_field(field, UnknownSpace.OCCUPIED).density(points) for field in (as_it_was, loaded)]
    assert torch.equal(*planned)


def test_a_file_that_memory_cannot_hold_is_refused_before_it_is_read(
    dense: VoxelField, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    save_field(dense, tmp_path / "dense.npz")
    monkeypatch.setattr("nerfnav.core.memory.available_memory", lambda: 10_000)
    with pytest.raises(InvalidInputError, match=r"dense\.npz may take .* GB, and .* GB of memory are free: .*voxel"):
        load_field(tmp_path / "dense.npz")
