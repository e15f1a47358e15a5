"""A field of a mesh: surfaces where triangles are, free space that cameras reach, and the colours of each side."""

import numpy as np
import pytest
import torch
import trimesh

from nerfnav.core.steps import run_steps
from nerfnav.field.core.occupancy import Occupancy, UnknownSpace
from nerfnav.field.edit.mesh_bake import MeshSurface, bake_mesh
from nerfnav.field.models.voxel import VoxelField
from nerfnav.geometry import Box

VOXEL = 0.05
BOX = Box.of((-0.2, -0.2, -0.2), (2.2, 1.2, 1.2))
RED, BLUE = (200, 40, 30), (30, 60, 210)


def walls() -> list[trimesh.Trimesh]:
    """Walls, 0.17 m thick, around a room of 2 x 1 x 1 m."""
    parts = []
    for axis, size in enumerate((2.0, 1.0, 1.0)):
        for at in (-0.085, size + 0.085):
            extents, middle = np.array([2.34, 1.34, 1.34]), np.array([1.0, 0.5, 0.5])
            extents[axis], middle[axis] = 0.17, at
            parts.append(trimesh.creation.box(extents).apply_translation(middle))
    return parts


def pillar() -> trimesh.Trimesh:
    """A pillar from floor to ceiling."""
    return trimesh.creation.box((0.3, 0.3, 1.2)).apply_translation((1.5, 0.5, 0.5))


def sheet(x: float) -> trimesh.Trimesh:
    """A wall without thickness across the room."""
    corners = [[x, -0.1, -0.1], [x, 1.1, -0.1], [x, 1.1, 1.1], [x, -0.1, 1.1]]
    return trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False)


def baked(parts: list[trimesh.Trimesh], places: tuple[tuple[float, float, float], ...]) -> VoxelField:
    """The field of some parts, each in its colour in turn, where a camera may stand within 0.3 m of these places."""
    mesh = trimesh.util.concatenate(parts)
    assert isinstance(mesh, trimesh.Trimesh)
    colors = np.concatenate([np.tile((RED, BLUE)[k % 2], (len(part.faces), 1)) for k, part in enumerate(parts)])

    def is_place(points: np.ndarray) -> np.ndarray:
        away = np.linalg.norm(points[:, None] - np.array(places).reshape(-1, 3), axis=-1)
        return (away < 0.3).any(1)

    surface = MeshSurface(np.asarray(mesh.triangles), lambda faces, weights: colors[faces])
    return run_steps(bake_mesh(surface, BOX, VOXEL, torch.zeros(3), is_place))


def state_at(field: VoxelField, *point: float) -> Occupancy:
    assert field.evidence is not None
    node = ((torch.tensor(point) - field.box.lower) / field.spacing).round().long()
    return Occupancy(int(field.evidence[tuple(node.tolist())]))


@pytest.fixture(scope="module")
def room() -> VoxelField:
    return baked([*walls(), pillar()], ((0.5, 0.5, 0.5),))


def test_the_room_is_free_and_what_no_way_leads_to_is_unproven(room: VoxelField) -> None:
    assert state_at(room, 0.5, 0.5, 0.5) is Occupancy.FREE
    assert state_at(room, 1.85, 0.5, 0.5) is Occupancy.FREE, "behind the pillar"
    assert state_at(room, 1.37, 0.5, 0.5) is Occupancy.SOLID
    assert state_at(room, -0.2, 0.5, 0.5) is not Occupancy.FREE, "outside of the walls"
    assert (room.info.made_by, room.info.proven_from) == ("baked", "mesh")
    planned = room.planning_view(UnknownSpace.OCCUPIED)
    free, outside = torch.tensor([[0.5, 0.5, 0.5]]), torch.tensor([[-0.19, 0.5, 0.5]])
    assert planned.density(free) < 1e-3 < 10 < planned.density(outside)


@pytest.mark.parametrize("way", [(-1.0, 0.0, 0.0), (0.0, 0.6, 0.8), (-0.6, 0.64, 0.48), (0.99, 0.1, 0.1)])
def test_rays_end_at_the_triangles(room: VoxelField, way: tuple[float, float, float]) -> None:
    origin, direction = torch.tensor([[0.5, 0.5, 0.45]]), torch.nn.functional.normalize(torch.tensor([way]))
    mesh = trimesh.util.concatenate([*walls(), pillar()])
    assert isinstance(mesh, trimesh.Trimesh)
    hits = mesh.ray.intersects_location(origin.numpy(), direction.numpy(), multiple_hits=False)[0]
    seen = room.render_rays(origin, direction)
    assert seen.opacity.item() > 0.99
    assert seen.depth.item() == pytest.approx(float(np.linalg.norm(hits[0] - origin.numpy())), abs=0.3 * VOXEL)


def test_a_sheet_between_two_rooms_stops_light_and_planners_from_both_sides() -> None:
    field = baked([*walls(), sheet(1.013)], ((0.5, 0.5, 0.5), (1.5, 0.5, 0.5)))
    assert state_at(field, 0.5, 0.5, 0.5) is state_at(field, 1.5, 0.5, 0.5) is Occupancy.FREE
    way = torch.tensor([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.8, 0.6, 0.0]])
    from_points = torch.tensor([[0.6, 0.5, 0.5], [1.5, 0.5, 0.5], [0.8, 0.3, 0.52]])
    seen = field.render_rays(from_points, way)
    assert (seen.opacity > 0.95).all()
    expected = torch.tensor([0.413, 0.487, 0.26625])
    assert ((seen.depth - expected).abs() < 1.2 * VOXEL).all(), "solid for a voxel on one side"
    across = torch.stack([torch.tensor([x, 0.5, 0.5]) for x in np.linspace(0.85, 1.15, 31)]).float()
    assert field.planning_view(UnknownSpace.OCCUPIED).density(across).max() > 20


def test_sides_of_a_thin_wall_keep_their_colours() -> None:
    left = trimesh.creation.box((0.06, 1.2, 1.2)).apply_translation((0.97, 0.5, 0.5))
    right = trimesh.creation.box((0.06, 1.2, 1.2)).apply_translation((1.03, 0.5, 0.5))
    field = baked([*walls(), left, right], ((0.5, 0.5, 0.5), (1.5, 0.5, 0.5)))
    origins = torch.tensor([[0.5, 0.52, 0.48], [1.5, 0.52, 0.48]])
    seen = field.render_rays(origins, torch.tensor([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]]))
    expected = torch.tensor([RED, BLUE]) / 255
    assert (seen.color - expected).abs().max() < 0.03


def test_without_a_place_for_a_camera_nothing_is_free() -> None:
    field = baked(walls(), ())
    assert field.evidence is not None and not (field.evidence == Occupancy.FREE).any()
