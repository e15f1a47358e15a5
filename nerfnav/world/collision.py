"""Collision geometry: all solids and sheets of a scene, indexed once, with tests of whether a body touches them."""

import math
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
from nerfnav.world.triangle_index import TriangleIndex, Triangles, boxes_touch_triangles


class Ground:
    """Collision geometry of a scene: all solids and sheets, indexed."""

    def __init__(self, scene: Scene) -> None:
        """Index the scene's triangles."""
        self._solids = [Solid(mesh) for mesh in scene.solids]
        bounds = np.array([(solid.lower, solid.upper) for solid in self._solids]).reshape(-1, 2, 3)
        self._lower, self._upper = bounds[:, 0], bounds[:, 1]
        self._sheets = TriangleIndex(_triangles(scene.sheets))
        triangles = _triangles((*scene.solids, *scene.sheets))
        self._index = TriangleIndex(triangles)
        corners = triangles.reshape(-1, 3)
        self.bounds: Float[np.ndarray, "2 3"] = (
            np.stack([corners.min(0), corners.max(0)]) if len(corners) else np.full((2, 3), np.nan)
        )
        """Lower and upper corner of all surfaces [m]; NaN where there are none."""

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

    def largest_slope(self, body: Body, state: RigidState) -> float:
        """Return the largest angle from level of the triangles that the box around a body touches [rad]; pi / 2 where
        it touches none."""
        rotations, centers = _numpy(RigidState.stack([state]))
        half = build_body_volume(body).half
        triangles = self._index.near(centers[0], float(np.linalg.norm(half)))
        corners = np.ascontiguousarray((triangles - centers[0]) @ rotations[0])
        triangles = triangles[boxes_touch_triangles(corners, half)]
        normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        upright = np.abs(normals[:, 2]) / np.maximum(np.linalg.norm(normals, axis=1), 1e-300)
        return float(np.arccos(np.clip(upright, 0, 1)).max(initial=0.0)) if len(triangles) else math.pi / 2

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
