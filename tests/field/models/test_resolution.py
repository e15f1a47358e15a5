"""Each kind of field has a resolution: the distance of its nodes, or of its samples where it has none."""

from dataclasses import replace

import torch

from nerfnav.field.models.bricks import convert_to_bricks
from nerfnav.field.render.composite import CompositeField, PlacedField
from nerfnav.geometry import Box, Pose
from nerfnav.planner.space.scales import grain_of
from tests.field.fields import ball, random_voxels


def test_the_resolution_of_a_grid_is_the_largest_distance_of_its_nodes_however_it_keeps_them() -> None:
    dense = replace(random_voxels(), box=Box.of((0.0, 0.0, 0.0), (1.0, 2.0, 4.0)))
    assert dense.resolution == float(dense.spacing.max()) == convert_to_bricks(dense).resolution
    assert dense.resolution > dense.spacing.min() and grain_of(dense) == dense.resolution


def test_the_resolution_of_a_field_without_nodes_is_the_distance_of_its_samples() -> None:
    formula = ball()
    assert formula.resolution == formula.step


def test_the_resolution_of_a_composite_field_is_that_of_its_finest_part() -> None:
    formula, dense = ball(), random_voxels()
    parts = tuple(PlacedField(part, Pose(torch.eye(3), torch.zeros(3))) for part in (formula, dense))
    assert CompositeField(parts).resolution == min(formula.resolution, dense.resolution)
