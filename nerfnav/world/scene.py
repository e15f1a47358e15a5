"""Scene: the ground truth of a place: its mesh, its solids, and the flights to try there.

A similarity transform moves a scene: its mesh, its solids, and the box
in which its field lives.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
import torch
import trimesh

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry import Box, Similarity
from nerfnav.world.surface import Paint
from nerfnav.world.task import Task


class Vantage(Enum):
    """Vantage: the positions from which a place is photographed."""

    ANYWHERE = "anywhere"
    """Any free position."""
    INSIDE = "inside"
    """A room: from where walls stand all around."""
    OUTSIDE = "outside"
    """Open ground: from where the sky is seen, and not from below the ground."""


@dataclass(frozen=True, eq=False)
class Scene:
    """Ground truth. Two scenes are the same only if they are the same object."""

    name: str
    """Name for users, as in `nerfnav plan NAME`."""
    title: str
    """Title for users."""
    mesh: trimesh.Trimesh
    """Visible mesh: sRGB vertex colours, face colours or a UV texture, light and shadow included."""
    solids: tuple[trimesh.Trimesh, ...]
    """Solids for contact: watertight parts, which may overlap one another."""
    box: Box
    """Domain of a field of the scene, in which a robot may fly."""
    sky: tuple[float, float, float]
    """sRGB colour of a ray that hits nothing, in [0, 1]."""
    tasks: tuple[Task, ...]
    """Flights to try, the first of them the default."""
    voxel: float | None = None
    """Size of the voxels that suit a field of it [m]; None where the usual size does."""
    paint: Paint | None = None
    """The mesh's colours, where they are more than the mesh itself can hold."""
    sheets: tuple[trimesh.Trimesh, ...] = ()
    """Surfaces for contact that have no inside: walls without thickness, ground without depth."""
    vantage: Vantage = Vantage.ANYWHERE
    """Vantage of its cameras."""


def move_scene(scene: Scene, similarity: Similarity, box: Box) -> Scene:
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
