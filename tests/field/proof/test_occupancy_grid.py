"""What a place says of what is unproven in it."""

from dataclasses import replace

import pytest
import torch

from nerfnav.field.core.info import FieldInfo
from nerfnav.field.core.occupancy import Occupancy
from nerfnav.field.models.bricks import convert_to_bricks
from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.proof.occupancy_grid import describe_unproven
from nerfnav.geometry.box import Box
from tests.planner.places import ball


def place(*layers: Occupancy) -> VoxelField:
    """A place of three layers, each of which is known throughout to be in a state."""
    states = torch.tensor([int(state) for state in layers], dtype=torch.uint8).repeat_interleave(4)
    values = torch.zeros(8, 8, 12, 4)
    values[..., 0] = -20.0
    box = Box(torch.zeros(3), torch.tensor([1.0, 1.0, 1.5]))
    return VoxelField(box, values, torch.ones(3), evidence=states.expand(8, 8, 12).clone())


@pytest.mark.parametrize(
    ("layers", "expected"),
    [
        ((Occupancy.UNPROVEN, Occupancy.FREE, Occupancy.FREE), "the floor"),
        ((Occupancy.SOLID, Occupancy.UNPROVEN, Occupancy.FREE), "half its height"),
        ((Occupancy.FREE, Occupancy.FREE, Occupancy.UNPROVEN), "high up"),
    ],
)
def test_a_place_says_how_much_is_unproven_and_what_photographs_would_help(
    layers: tuple[Occupancy, ...], expected: str
) -> None:
    text = describe_unproven(place(*layers))
    assert text.startswith("33% of this place is unproven") and expected in text and "or depth maps" in text


def test_bricks_say_what_the_dense_field_says():
    field = place(Occupancy.FREE, Occupancy.SOLID, Occupancy.UNPROVEN)
    dense, bricks = field.unproven_by_height, convert_to_bricks(field).unproven_by_height
    assert dense is not None and bricks is not None
    assert torch.allclose(bricks, dense)
    assert describe_unproven(convert_to_bricks(field)) == describe_unproven(field) != ""


def test_a_place_that_depth_has_proven_asks_for_photographs_alone():
    field = place(Occupancy.UNPROVEN, Occupancy.FREE, Occupancy.FREE)
    assert "depth maps" not in describe_unproven(replace(field, info=FieldInfo(proven_from="depth")))


@pytest.mark.parametrize("info", [FieldInfo(proven_from="mesh"), FieldInfo(proven_from="depth", truth="truth.npz")])
def test_a_place_that_was_made_of_a_mesh_asks_for_no_photographs(info: FieldInfo):
    text = describe_unproven(replace(place(Occupancy.UNPROVEN, Occupancy.FREE, Occupancy.FREE), info=info))
    assert "the floor" in text and "photograph" not in text


def test_a_place_that_is_known_says_nothing():
    assert describe_unproven(place(Occupancy.FREE, Occupancy.SOLID, Occupancy.FREE)) == ""


def test_a_place_without_proofs_says_so():
    assert "not proven" in describe_unproven(replace(place(*3 * [Occupancy.FREE]), evidence=None))
    assert "not proven" in describe_unproven(ball())
