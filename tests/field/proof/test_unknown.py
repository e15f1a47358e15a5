"""Unproven space: what planners make of it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from nerfnav.core.errors import FieldFileError
from nerfnav.field.core.occupancy import (
    EMPTY_RAW,
    Occupancy,
    UnknownSpace,
    classify_nodes,
    classify_unseen,
    planning_field,
    planning_raw,
)
from nerfnav.field.core.protocol import density_and_gradient
from nerfnav.field.models import grid_field
from nerfnav.field.models.bricks import convert_to_bricks
from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.render.composite import CompositeField, PlacedField
from nerfnav.field.storage.checkpoint import load_field, save_field
from nerfnav.geometry.camera import Pose
from nerfnav.geometry.grid import node_positions
from tests.field.fields import BOX, ball

SHAPE = (51, 51, 28)
RADIUS = node_positions(BOX, SHAPE).norm(dim=-1)


@pytest.fixture(scope="module")
def hollow() -> VoxelField:
    """A hollow ball of radius 0.3 in light fog, whose outside is proven free; its shell is two voxels thick."""
    values = torch.full((*SHAPE, 4), -9.0)  # 0.05 / m
    values[..., 0] = torch.where((RADIUS - 0.28).abs() < 0.04, 0.5, values[..., 0])
    return VoxelField(BOX, values, torch.ones(3), evidence=classify_nodes(RADIUS > 0.34, values[..., 0]))


def test_planners_take_unproven_space_for_solid_unless_told_otherwise(hollow: VoxelField):
    inside = torch.zeros(1, 3)
    assert hollow.density(inside).item() < 1
    assert planning_field(hollow, UnknownSpace.OCCUPIED).density(inside).item() > 40
    assert planning_field(hollow, UnknownSpace.FREE).density(inside).item() < 1


def test_there_is_no_density_where_space_is_proven_free(hollow: VoxelField):
    outside = torch.tensor([[0.42, 0.0, 0.0]])
    assert hollow.density(outside).item() > 0.04
    for unknown in UnknownSpace:
        assert planning_field(hollow, unknown).density(outside).item() < 1e-5


def test_the_planners_field_is_made_once_and_keeps_its_fast_densities(hollow: VoxelField):
    solid = planning_field(hollow, UnknownSpace.OCCUPIED)
    assert planning_field(hollow, UnknownSpace.OCCUPIED) is solid
    points = np.random.default_rng(0).uniform(-0.3, 0.3, (200, 3))
    density, _ = density_and_gradient(solid, points)
    np.testing.assert_allclose(density, solid.density(torch.from_numpy(points)).numpy(), rtol=1e-4, atol=1e-3)


def test_fields_without_evidence_are_planned_in_as_they_are(hollow: VoxelField):
    known = replace(hollow, evidence=None)
    assert planning_field(known, UnknownSpace.OCCUPIED) is known
    formula = ball()
    assert planning_field(formula, UnknownSpace.OCCUPIED) is formula


@pytest.mark.parametrize("unknown", UnknownSpace)
def test_a_field_whose_states_are_looked_at_part_after_part_is_the_same(
    hollow: VoxelField, unknown: UnknownSpace, monkeypatch: pytest.MonkeyPatch
) -> None:
    states = torch.randint(0, 3, SHAPE, generator=torch.Generator().manual_seed(0)).to(torch.uint8)
    for field in (replace(hollow, evidence=states), convert_to_bricks(replace(hollow, evidence=states))):
        assert field.evidence is not None
        wanted = planning_raw(field.values[..., 0], field.evidence, unknown)
        for nodes in (1, 3000, 1 << 30):  # one layer after the other, two at once, all of them
            monkeypatch.setattr(grid_field, "_AT_ONCE", nodes)
            planned = replace(field).planning_view(unknown)
            assert torch.equal(planned.values[..., 0], wanted)
            assert torch.equal(planned.values[..., 1:], field.values[..., 1:])


def test_unknown_space_of_a_part_of_a_composite_field_is_solid_too(hollow: VoxelField) -> None:
    place = Pose(torch.eye(3), torch.zeros(3))
    planned = planning_field(CompositeField((PlacedField(hollow, place),)), UnknownSpace.OCCUPIED)
    middle = torch.zeros(1, 3)
    assert torch.equal(planned.density(middle), planning_field(hollow, UnknownSpace.OCCUPIED).density(middle))
    assert planned.density(middle) > hollow.density(middle)


def test_older_files_which_tell_what_no_camera_saw_still_load(hollow: VoxelField, tmp_path: Path):
    unseen, path = RADIUS < 0.2, tmp_path / "field.npz"
    save_field(replace(hollow, evidence=None), path)
    with np.load(path, allow_pickle=False) as file:
        arrays = dict(file)
    np.savez_compressed(path, **arrays, unknown=np.packbits(unseen.numpy()))
    old = load_field(path)
    assert isinstance(old, VoxelField) and old.unknown is not None
    assert torch.equal(old.unknown, unseen)
    # nothing that such a file says is taken away
    shell = torch.tensor([[0.28, 0.0, 0.0], [0.42, 0.0, 0.0]])
    torch.testing.assert_close(old.planned.density(shell), old.density(shell))
    assert old.planned.density(torch.zeros(1, 3)).item() > 40


def test_evidence_of_another_shape_is_no_whole_file(hollow: VoxelField, tmp_path: Path):
    path = tmp_path / "field.npz"
    save_field(hollow, path)
    with np.load(path, allow_pickle=False) as file:
        arrays = dict(file)
    np.savez_compressed(path, **{**arrays, "evidence": arrays["evidence"][1:]})
    with pytest.raises(FieldFileError, match="not a whole nerfnav field"):
        load_field(path)


def test_what_was_seen_in_an_older_file_is_as_the_field_says():
    raw = torch.tensor([[[EMPTY_RAW, -9.0, 0.0]]])
    unseen = torch.tensor([[[False, False, True]]])
    assert classify_unseen(unseen, raw).tolist() == [[[Occupancy.FREE, Occupancy.SOLID, Occupancy.UNPROVEN]]]
