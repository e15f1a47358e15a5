"""Collision geometry: all solids and sheets of a scene, indexed once, with tests of whether a body touches them."""

from functools import lru_cache

import numpy as np
import torch
import trimesh
from jaxtyping import Bool, Float
from torch import Tensor

from nerfnav.robots import Body, RigidState
from nerfnav.world.body_volume import BodyVolume, build_body_volume
from nerfnav.world.scene import Scene
from nerfnav.world.solid import Solid, overlap_volume
from nerfnav.world.triangle_index import TriangleIndex, Triangles


class Ground:
    """Collision geometry of a scene: all solids and sheets, indexed."""

    def __init__(self, scene: Scene) -> None:
        """Index the scene's triangles."""
        self._solids = [Solid(mesh) for mesh in scene.solids]
        bounds = np.array([(solid.lower, solid.upper) for solid in self._solids]).reshape(-1, 2, 3)
        self._lower, self._upper = bounds[:, 0], bounds[:, 1]
        self._sheets = TriangleIndex(_triangles(scene.sheets))
        self._index = TriangleIndex(_triangles((*scene.solids, *scene.sheets)))

    def touches(self, body: Body, states: RigidState) -> Bool[Tensor, " n"]:
        """Mark states, batch shape (n,), at which the body touches a surface or lies inside a solid."""
        rotations, centers = _numpy(states)
        volume = build_body_volume(body)
        touched = self._index.touched(rotations, centers, volume.half)
        for index in np.flatnonzero(((self._lower <= centers.max(0)) & (self._upper >= centers.min(0))).all(1)):
            free = np.flatnonzero(~touched)
            touched[free] = self._solids[index].contains(centers[free])
        if not volume.is_box:  # what touches the box around it need not touch the body
            for index in np.flatnonzero(touched):
                touched[index] = self._overlap(volume, rotations[index], centers[index]) > 0
        return torch.from_numpy(touched)

    def overlaps(self, body: Body, states: RigidState) -> Float[Tensor, " n"]:
        """Volume [m^3] that the body shares with the solids at each state, batch shape (n,).

        Sheets have no volume: of a body that they go through, they count the cells (an eighth of an edge) they cross.
        """
        volume = build_body_volume(body)
        volumes = [self._overlap(volume, rotation, center) for rotation, center in zip(*_numpy(states), strict=True)]
        return torch.tensor(volumes, dtype=torch.float64)

    def _overlap(self, body: BodyVolume, rotation: np.ndarray, center: np.ndarray) -> float:
        shared = overlap_volume(self._solids, body, rotation, center)
        crossed = body.crossed(self._sheets, rotation, center)
        middles = body.middles[crossed] @ rotation.T + center
        for solid in self._solids if crossed.any() else ():  # what these hold is counted already
            middles = middles[~solid.contains(middles)]
        return shared + len(middles) * body.cell_volume


def _triangles(meshes: tuple[trimesh.Trimesh, ...]) -> Triangles:
    return np.concatenate([np.zeros((0, 3, 3)), *(np.asarray(mesh.triangles) for mesh in meshes)])


def _numpy(states: RigidState) -> tuple[np.ndarray, np.ndarray]:
    """Rotations (n, 3, 3) and positions (n, 3) in double precision."""
    rotations, centers = (x.detach().cpu().double().numpy() for x in (states.rotation, states.position))
    return rotations, centers


@lru_cache(maxsize=4)
def ground(scene: Scene) -> Ground:
    """The scene's solids, indexed once."""
    return Ground(scene)
