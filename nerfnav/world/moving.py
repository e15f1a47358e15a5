"""Ground truth after a similarity transform of the world: the mesh, what is touched, and where the field lives."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch
import trimesh

from nerfnav.errors import InvalidInputError
from nerfnav.geometry import Box, Similarity
from nerfnav.world.scene import Scene


def moved_scene(scene: Scene, similarity: Similarity, box: Box) -> Scene:
    """The scene where `similarity` takes it, whose field lives in `box` [m] now.

    Its paint stays, as it belongs to faces. Raises InvalidInputError for a scene with tasks, which are for robots of
    one size on one floor.
    """
    if scene.tasks:
        raise InvalidInputError(f"the tasks of {scene.name} cannot be moved with it")
    return replace(
        scene,
        mesh=_moved([scene.mesh], similarity)[0],
        solids=_moved(scene.solids, similarity),
        sheets=_moved(scene.sheets, similarity),
        box=box,
        voxel=None if scene.voxel is None else similarity.scale * scene.voxel,
    )


def _moved(meshes: Sequence[trimesh.Trimesh], similarity: Similarity) -> tuple[trimesh.Trimesh, ...]:
    def vertices(mesh: trimesh.Trimesh) -> np.ndarray:
        return similarity(torch.from_numpy(np.array(mesh.vertices, dtype=np.float64))).numpy()

    return tuple(trimesh.Trimesh(vertices(mesh), np.array(mesh.faces), process=False) for mesh in meshes)
