"""A roofed place is shown without the faces that no camera saw."""

import numpy as np
import pytest
import torch

from nerfnav.field.core.occupancy import EMPTY_RAW, Occupancy
from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.surface.mesh import field_mesh
from nerfnav.field.surface.open_rooms import open_rooms
from nerfnav.geometry.box import Box

_SPACING = 0.05
_INNER, _OUTER = 0.5, 0.8
"""Half the inner and the outer edge of a room's walls [m]; beyond them no camera has been."""


def room(roof: bool) -> VoxelField:
    """A room of solid walls, as nodes 5 cm apart, with a table in it; only the inside is proven free."""
    axis = torch.linspace(-1, 1, 41)
    x, y, z = torch.meshgrid(axis, axis, axis, indexing="ij")
    farthest = torch.stack([x.abs(), y.abs(), z.abs()]).amax(0)
    inside = farthest < _INNER
    if not roof:
        inside |= (torch.maximum(x.abs(), y.abs()) < _INNER) & (z > 0)
    table = (x.abs() < 0.2) & (y.abs() < 0.2) & ((z + 0.2).abs() < 0.08)
    solid = (farthest < _OUTER) & ~inside | table
    states = torch.full(solid.shape, int(Occupancy.UNPROVEN), dtype=torch.uint8)
    states[inside & ~table], states[solid] = int(Occupancy.FREE), int(Occupancy.SOLID)
    values = torch.full((*solid.shape, 4), 0.5)
    values[..., 0] = torch.where(solid, 0.5, EMPTY_RAW)
    return VoxelField(Box.of((-1, -1, -1), (1, 1, 1)), values, torch.ones(3), evidence=states)


def test_what_is_left_of_a_roofed_room_is_its_inside_and_what_stands_there() -> None:
    field = room(roof=True)
    whole = field_mesh(field, _SPACING)
    opened = open_rooms(field, whole, _SPACING)
    reach = np.abs(opened.vertices).max()
    assert np.abs(whole.vertices).max() > 0.75 and reach == pytest.approx(_INNER, abs=0.05)
    table, before = (np.abs(mesh.triangles_center).max(1) < 0.35 for mesh in (opened, whole))
    assert table.sum() == before.sum() > 20
    walls = opened.triangles_center[~table]
    assert (np.einsum("ij,ij->i", walls, opened.face_normals[~table]) < 0).all(), "a wall's face looks out of the room"


def test_fog_in_space_that_is_proven_free_is_not_shown() -> None:
    field = room(roof=True)
    field.values[19:22, 19:22, 25:28, 0] = 0.5
    whole = field_mesh(field, _SPACING)
    fog = np.array([0.0, 0.0, 0.3])
    opened = open_rooms(field, whole, _SPACING)
    near = [np.linalg.norm(mesh.triangles_center - fog, axis=1).min() for mesh in (whole, opened)]
    assert near[0] < 0.1 < near[1]


def test_a_place_without_a_roof_is_shown_whole() -> None:
    field = room(roof=False)
    mesh = field_mesh(field, _SPACING)
    assert open_rooms(field, mesh, _SPACING) is mesh
