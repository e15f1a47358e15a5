"""Ground truth as a field: every node within half a voxel of a solid is dense, all else is empty."""

import itertools

import numpy as np
import torch
import trimesh

from nerfnav.field.core.occupancy import EMPTY_RAW
from nerfnav.field.models.voxel import VoxelField
from nerfnav.geometry.grid import node_positions, shape_for
from nerfnav.world.scene import Scene
from nerfnav.world.solid import Solid

_DENSE_RAW = 1.0


def raster_field(scene: Scene, voxel: float) -> VoxelField:
    """A field of a scene's solids with nodes about `voxel` [m] apart. Surfaces are dense however thin a solid is."""
    shape = shape_for(scene.box, voxel)
    nodes = node_positions(scene.box, shape).double().numpy()
    lower, spacing = nodes[0, 0, 0], nodes[1, 1, 1] - nodes[0, 0, 0]
    dense = np.zeros(shape, bool)
    for mesh in scene.solids:
        touched = np.round((_surface_points(mesh, 0.5 * voxel) - lower) / spacing).astype(int)
        dense[tuple(touched.T)] = True
        low, high = touched.min(0), touched.max(0) + 1
        window = tuple(itertools.starmap(slice, zip(low, high, strict=True)))
        inside = Solid(mesh).contains(nodes[window].reshape(-1, 3)).reshape(dense[window].shape)
        dense[window] |= inside
    values = torch.full((*shape, 4), EMPTY_RAW)
    values[..., 0][torch.from_numpy(dense)] = _DENSE_RAW
    return VoxelField(scene.box, values, torch.ones(3))


def _surface_points(mesh: trimesh.Trimesh, spacing: float) -> np.ndarray:
    """Points (n, 3) on a mesh, at most `spacing` [m] from the next: on a regular grid in each face, edges included."""
    faces, points = mesh.triangles, []
    longest = np.linalg.norm(faces - np.roll(faces, 1, axis=1), axis=-1).max(1)
    parts = np.maximum(1, np.ceil(longest / spacing)).astype(int)
    for count in np.unique(parts):
        i, j = np.mgrid[: count + 1, : count + 1]
        i, j = i[i + j <= count], j[i + j <= count]
        weights = np.stack([i, j, count - i - j], -1) / count
        points.append(np.einsum("wc,fcx->fwx", weights, faces[parts == count]).reshape(-1, 3))
    return np.concatenate(points)
