"""Unknown space: what no camera saw into, and what planners make of it."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from nerfnav.field.composite import CompositeField, PlacedField
from nerfnav.field.field import density_and_gradient
from nerfnav.field.unknown import Unknown, planning_field, with_unknown
from nerfnav.field.voxel import EMPTY_RAW, VoxelField
from nerfnav.geometry.camera import Pose
from nerfnav.geometry.grid import node_positions
from tests.field.fields import BOX, ball, photographs_of_ball


@pytest.fixture(scope="module")
def hollow() -> VoxelField:
    """A hollow ball of radius 0.3, seen from all around; its shell is two voxels thick."""
    values = torch.full((51, 51, 28, 4), EMPTY_RAW)
    radius = node_positions(BOX, (51, 51, 28)).norm(dim=-1)
    values[..., 0] = torch.where((radius - 0.28).abs() < 0.04, torch.tensor(0.5), values[..., 0])
    field = VoxelField(BOX, values, torch.ones(3))
    return with_unknown(field, photographs_of_ball(60, size=32), torch.Generator().manual_seed(0))


def radii(field: VoxelField) -> torch.Tensor:
    return node_positions(field.box, field.shape).norm(dim=-1)


def test_the_inside_of_a_hollow_body_is_unknown_and_the_air_around_it_is_not(hollow: VoxelField):
    assert hollow.unknown is not None
    radius = radii(hollow)
    assert hollow.unknown[radius < 0.2].float().mean() > 0.99
    assert hollow.unknown[(radius > 0.36) & (radius < 0.45)].float().mean() < 0.01


def test_planners_take_unknown_space_for_solid_unless_told_otherwise(hollow: VoxelField):
    inside, outside = torch.zeros(1, 3), torch.tensor([[0.42, 0.0, 0.0]])
    solid = planning_field(hollow, Unknown.OCCUPIED)
    assert hollow.density(inside).item() < 1 < 100 < solid.density(inside).item()
    assert solid.density(outside).item() < 1
    assert planning_field(hollow, Unknown.FREE) is hollow


def test_the_planners_field_is_made_once_and_keeps_its_fast_densities(hollow: VoxelField):
    solid = planning_field(hollow, Unknown.OCCUPIED)
    assert planning_field(hollow, Unknown.OCCUPIED) is solid
    points = np.random.default_rng(0).uniform(-0.3, 0.3, (200, 3))
    density, _ = density_and_gradient(solid, points)
    np.testing.assert_allclose(density, solid.density(torch.from_numpy(points)).numpy(), rtol=1e-4, atol=1e-3)


def test_fields_that_know_of_no_unknown_are_planned_in_as_they_are(hollow: VoxelField):
    known = replace(hollow, unknown=None)
    assert planning_field(known, Unknown.OCCUPIED) is known
    formula = ball()
    assert planning_field(formula, Unknown.OCCUPIED) is formula


def test_unknown_space_of_a_part_of_a_composite_field_is_solid_too(hollow: VoxelField) -> None:
    place = Pose(torch.eye(3), torch.zeros(3))
    planned = planning_field(CompositeField((PlacedField(hollow, place),)), Unknown.OCCUPIED)
    middle = torch.zeros(1, 3)
    assert torch.equal(planned.density(middle), planning_field(hollow, Unknown.OCCUPIED).density(middle))
    assert planned.density(middle) > hollow.density(middle)
