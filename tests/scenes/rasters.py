"""Ground truth as a field: every node within half a voxel of a solid is dense, all else is empty."""

import itertools

import numpy as np
import torch
import trimesh

from nerfnav.field.voxel import EMPTY_RAW, VoxelField
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
        corners, faces = trimesh.remesh.subdivide_to_size(mesh.vertices, mesh.faces, 0.5 * voxel)[:2]
        touched = np.round((corners[np.unique(faces)] - lower) / spacing).astype(int)
        dense[tuple(touched.T)] = True
        low, high = touched.min(0), touched.max(0) + 1
        window = tuple(itertools.starmap(slice, zip(low, high, strict=True)))
        inside = Solid(mesh).contains(nodes[window].reshape(-1, 3)).reshape(dense[window].shape)
        dense[window] |= inside
    values = torch.full((*shape, 4), EMPTY_RAW)
    values[..., 0][torch.from_numpy(dense)] = _DENSE_RAW
    return VoxelField(scene.box, values, torch.ones(3))
