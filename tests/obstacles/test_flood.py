"""Flood: the part of a place that a click means is what is joined above its support."""

import numpy as np
import pytest
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.field import GridField, load_field
from nerfnav.field.models.bricks import convert_to_bricks
from nerfnav.field.models.voxel import EMPTY_RAW, VoxelField
from nerfnav.geometry import Box
from nerfnav.obstacles import BoxShape, CutOut, Obstacle, PartBox, find_part, require_placeable
from nerfnav_scenes import trained_path

H = 0.05
TABLE = ((1.0, 1.0, 0.5), (0.8, 0.6, 0.1), 0.0)  # middle, edges, yaw of its top
LEGS = [((1.0 + x, 1.0 + y, 0.3), (0.1, 0.1, 0.5), 0.0) for x in (-0.3, 0.3) for y in (-0.2, 0.2)]
LAMP = ((0.9, 1.0, 0.75), (0.1, 0.1, 0.5), 0.0)
PILLAR = ((2.2, 2.2, 0.5), (0.6, 0.2, 0.9), 0.5)
FLOOR, WALL = ((1.5, 1.5, 0.0), (4.0, 4.0, 0.2), 0.0), ((0.0, 1.5, 0.8), (0.2, 4.0, 2.0), 0.0)


def furnished() -> VoxelField:
    """A floor up to 10 cm, a wall, a table with a lamp on it, and a pillar that is turned; noise in the floor."""
    shape = (61, 61, 31)
    nodes = torch.stack(torch.meshgrid(*(torch.arange(count) * H for count in shape), indexing="ij"), -1).double()
    gap = torch.full(shape, 1.0).double()
    for middle, edges, yaw in (TABLE, *LEGS, LAMP, PILLAR, FLOOR, WALL):
        cos, sin = np.cos(yaw), np.sin(yaw)
        own = (nodes - torch.tensor(middle).double()) @ torch.tensor([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
        gap = torch.minimum(gap, (own.abs() - torch.tensor(edges).double() / 2).amax(-1))
    rough = torch.rand(shape, generator=torch.Generator().manual_seed(0)) < 0.3
    gap = torch.where(rough & (nodes[..., 2] < 0.16), gap.clamp_max(-0.01), gap)
    values = torch.full((*shape, 4), EMPTY_RAW)
    values[..., 0] = (-200 * gap + 1).clamp(EMPTY_RAW, 4)
    return VoxelField(Box.of((0, 0, 0), (3, 3, 1.5)), values, torch.ones(3))


FIELD = furnished()


@pytest.mark.parametrize("field", [FIELD, convert_to_bricks(FIELD)], ids=["voxels", "bricks"])
@pytest.mark.parametrize(
    ("click", "low", "high"),
    [
        ((1.2, 1.1, 0.55), (0.6, 0.7, 0.12), (1.4, 1.3, 1.0)),  # its top: all of it, with the lamp
        ((1.3, 1.15, 0.3), (0.6, 0.7, 0.12), (1.4, 1.3, 1.0)),  # a leg
    ],
)
def test_a_table_is_selected_with_its_legs_and_what_stands_on_it(
    field: GridField, click: tuple[float, float, float], low: tuple[float, ...], high: tuple[float, ...]
) -> None:
    part = find_part(field, click)
    assert part.yaw == 0
    np.testing.assert_allclose(np.array(part.position) - np.array(part.extents) / 2, low, atol=2 * H)
    np.testing.assert_allclose(np.array(part.position) + np.array(part.extents) / 2, high, atol=2 * H)


def test_a_turned_pillar_has_a_turned_box_that_holds_it_and_no_more() -> None:
    part = find_part(FIELD, (2.2, 2.2, 0.6))
    turn = part.yaw - PILLAR[2]
    edges = np.array(part.extents) if abs(np.sin(turn)) < 0.2 else np.array(part.extents)[[1, 0, 2]]
    assert min(abs(np.sin(turn)), abs(np.cos(turn))) < 0.1, np.degrees(part.yaw)
    np.testing.assert_allclose(edges - PILLAR[1], 0.1, atol=0.12)
    cut_out = CutOut(BoxShape(part.extents), part.position, (0.0, 0.0, part.yaw))
    require_placeable(FIELD, Obstacle("pillar", cut_out, part.position, (0.0, 0.0, part.yaw)))


@pytest.mark.parametrize("click", [(2.6, 0.6, 0.1), (0.1, 2.0, 0.8)], ids=["floor", "wall"])
def test_what_goes_on_beyond_the_place_is_refused(click: tuple[float, float, float]) -> None:
    with pytest.raises(InvalidInputError, match=r"beyond the place, or for more than 7\.0 m, as a wall"):
        find_part(FIELD, click)


def test_what_goes_on_beyond_what_is_searched_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("nerfnav.obstacles.flood._REACH", 12)
    assert find_part(FIELD, (1.0, 1.0, 0.55)).extents[2] < 1.1, "the table fits in what is searched"
    monkeypatch.setattr("nerfnav.obstacles.flood._REACH", 7)
    with pytest.raises(InvalidInputError, match=r"for more than 0\.4 m"):
        find_part(FIELD, (1.0, 1.0, 0.55))


def test_a_click_into_the_air_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="met nothing solid: click onto a surface"):
        find_part(FIELD, (2.5, 1.0, 1.2))


@pytest.mark.parametrize(
    ("click", "expected"),
    [
        ((-0.75, -1.75, 0.43), PartBox((0.7, 1.1, 0.5), (-0.75, -1.75, 0.25), 0.0)),  # coffee table
        ((-3.2, -2.6, 0.75), PartBox((1.6, 1.0, 0.8), (-3.2, -2.6, 0.4), 0.0)),  # dining table
    ],
)
def test_tables_of_the_apartment_are_found_in_its_trained_field(
    click: tuple[float, float, float], expected: PartBox
) -> None:
    part = find_part(load_field(trained_path("apartment")), click)
    np.testing.assert_allclose(part.extents, expected.extents, atol=0.15)
    np.testing.assert_allclose(part.position, expected.position, atol=0.1)
