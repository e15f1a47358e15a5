"""Atlases of meshes, and what is baked into them."""

from collections.abc import Callable

import numpy as np
import pytest
import torch
import trimesh

from nerfnav.core.errors import InvalidInputError
from nerfnav.core.steps import run_steps
from nerfnav.field.core.protocol import Field
from nerfnav.field.models.bricks import convert_to_bricks
from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.surface.atlas import LARGEST, atlas_of
from nerfnav.field.surface.mesh import field_mesh
from nerfnav.field.surface.texture import TexturedMesh, texture_mesh
from tests.field.fields import BOX, ball

MOST = 1 << 20
Make = Callable[[], trimesh.Trimesh]


def noisy_ball() -> trimesh.Trimesh:
    mesh = trimesh.creation.icosphere(subdivisions=4)
    mesh.vertices += np.random.default_rng(0).normal(0, 0.02, mesh.vertices.shape)
    return mesh


def ring() -> trimesh.Trimesh:
    return trimesh.creation.torus(1.0, 0.3)


def striped(side: int = 41) -> VoxelField:
    """A slab below z = 0 whose colour changes along x from node to node."""
    axes = [torch.linspace(low, high, n) for low, high, n in zip(BOX.lower, BOX.upper, (side, side, side), strict=True)]
    _, _, z = torch.meshgrid(*axes, indexing="ij")
    values = torch.zeros(side, side, side, 4)
    values[..., 0] = torch.where(z < 0, 3.0, -12.0)
    values[..., 1:] = 0.2 + 0.6 * (torch.arange(side) % 2)[:, None, None, None]
    return VoxelField(BOX, values, torch.ones(3))


def looked_up(mesh: TexturedMesh, face: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """The nearest texel of points on triangles, as (n, 3) in [0, 1]."""
    uv = (mesh.uv[mesh.faces[face]] * weights[..., None]).sum(1)
    column, row = (uv * mesh.picture.shape[1::-1]).astype(int).T
    return mesh.picture[row, column] / 255.0


@pytest.mark.parametrize("make", [trimesh.creation.box, ring, noisy_ball])
def test_each_triangle_is_where_the_atlas_says_and_none_lies_upon_it(make: Make) -> None:
    mesh = make()
    atlas = atlas_of(mesh.vertices, mesh.faces, 0.02 * mesh.scale, MOST)
    np.testing.assert_array_equal(atlas.vertices[atlas.faces], mesh.faces)
    points = mesh.triangles.mean(1)
    column, row = np.round(atlas.texels[atlas.faces].mean(1)).astype(int).T
    apart = np.linalg.norm(atlas.shown(mesh.vertices, row * atlas.size[1] + column) - points, axis=1)
    assert apart.max() < 0.06 * mesh.scale
    assert (atlas.texels >= 2).all() and (atlas.texels <= np.array(atlas.size[::-1]) - 3).all()


def test_an_atlas_with_too_many_texels_gets_larger_ones() -> None:
    mesh = trimesh.creation.icosphere(subdivisions=4)
    small = atlas_of(mesh.vertices, mesh.faces, 1e-5, 1 << 16)
    assert small.size[0] * small.size[1] <= 1 << 16 and max(small.size) <= LARGEST


def test_nothing_has_no_atlas() -> None:
    with pytest.raises(InvalidInputError, match="this one has none"):
        atlas_of(np.zeros((0, 3)), np.zeros((0, 3), int), 0.1, MOST)


@pytest.mark.parametrize("kept", [lambda field: field, convert_to_bricks])
def test_a_texture_tells_apart_what_vertices_are_too_far_apart_for(kept: Callable[[VoxelField], Field]) -> None:
    field, finest = striped(), float(striped().spacing.min())
    mesh = field_mesh(field, 4 * finest, level=20.0)
    made = run_steps(texture_mesh(kept(field), mesh, finest))
    flat = mesh.face_normals[:, 2] > 0.99
    points, face = trimesh.sample.sample_surface(mesh, 4000, face_weight=flat * mesh.area_faces, seed=0)
    weights = trimesh.triangles.points_to_barycentric(mesh.triangles[face], points)
    seen = looked_up(made, face, weights)
    wanted = field.radiance(torch.from_numpy(points).float(), torch.zeros(len(points), 3)).numpy()
    assert np.abs(seen - wanted).mean() < 0.06
    corners = np.asarray(mesh.visual.vertex_colors)[mesh.faces[face], :3] / 255.0
    assert np.abs((corners * weights[..., None]).sum(1) - wanted).mean() > 0.12


def test_a_field_without_a_renderer_gives_its_colours_below_the_surface() -> None:
    field = ball()
    mesh = field_mesh(field, 0.03)
    made = run_steps(texture_mesh(field, mesh, 0.02))
    weights = np.full((len(mesh.faces), 3), 1 / 3)
    points = torch.from_numpy(mesh.triangles.mean(1)).float()
    seen = looked_up(made, np.arange(len(mesh.faces)), weights)
    assert np.abs(seen - field.radiance(points, points).numpy()).mean() < 0.1
