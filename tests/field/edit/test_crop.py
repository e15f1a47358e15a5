"""Parts of fields."""

from dataclasses import replace

import pytest
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.field.edit.crop import crop_field
from nerfnav.field.models.voxel import VoxelField
from nerfnav.geometry.box import Box
from tests.field.moves import change, likeness, room

PART = Box.of((-0.45, -0.42, -0.1), (0.45, 0.3, 0.62))


def test_what_is_kept_is_as_it_was() -> None:
    field, part = room(), crop_field(room(), PART)
    assert isinstance(part, VoxelField) and part.evidence is not None
    torch.testing.assert_close(part.box.lower, PART.lower)
    torch.testing.assert_close(part.box.upper, PART.upper)
    points = part.box.lower + torch.rand(4000, 3, generator=torch.Generator().manual_seed(0)) * part.box.size
    torch.testing.assert_close(part.planned.density(points), field.planned.density(points), rtol=1e-3, atol=1e-3)


def test_a_box_that_sticks_out_keeps_what_is_there() -> None:
    part = crop_field(room(), Box.of((-5, -5, -5), (5, 5, 0.5)))
    torch.testing.assert_close(part.box.lower, room().box.lower)
    assert part.box.upper[2].item() == pytest.approx(0.5)


def test_pictures_still_show_what_was_cut_off_where_there_are_surroundings() -> None:
    field = room(outside=True)
    part = crop_field(field, Box.of((-0.45, -0.45, -0.1), (0.25, 0.45, 0.7)))  # the wall is cut off
    assert isinstance(part, VoxelField)
    shown = likeness(field, part, change(), inside=True)
    assert shown > 14 and shown > likeness(field, replace(part, outside=None), change(), inside=True) + 2


@pytest.mark.parametrize("corner", [0.61, 5.0])
def test_a_box_outside_the_place_is_refused(corner: float) -> None:
    with pytest.raises(InvalidInputError, match="outside the place"):
        crop_field(room(), Box.of((corner, 0, 0), (corner + 1, 1, 1)))


def test_a_box_of_next_to_nothing_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="less than 4 voxels"):
        crop_field(room(), Box.of((0, 0, 0), (0.04, 0.5, 0.5)))
