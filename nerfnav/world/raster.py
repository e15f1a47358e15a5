"""Rasteriser: the first hits of all rays of a pinhole camera on a mesh, found together.

The same as asking for each ray alone (nerfnav/world/raycast.py), in a quarter of the time and without the
interpreter's lock.
"""


from dataclasses import dataclass

import numpy as np
import torch
import trimesh
from jaxtyping import Float32, Float64, Int32

from nerfnav.geometry import Camera, Pose
from nerfnav.world.kernels.raster import draw, project, weigh


@dataclass(frozen=True)
class Hits:
    """What n rays hit first."""

    face: Int32[np.ndarray, " n"]
    """Index of the face, -1 where nothing is hit."""
    weights: Float32[np.ndarray, "n 3"]
    """Barycentric weights of the face's corners."""
    distance: Float32[np.ndarray, " n"]
    """From the ray's origin [m], infinite where nothing is hit."""


_IMAGE_AXES = np.array([1.0, -1.0, -1.0])[:, None]
"""From a camera's axes to right, down and forward."""


class Rasteriser:
    """A mesh before pinhole cameras; not for two threads at once, as each picture is drawn in the same memory."""

    def __init__(self, mesh: trimesh.Trimesh) -> None:
        """Of `mesh`, positions are taken in single precision, as by all who look at it."""
        self._vertices = np.ascontiguousarray(mesh.vertices, np.float32)
        self._faces = np.ascontiguousarray(mesh.faces, np.int32)
        count = len(self._vertices)
        self._points, self._stands = np.empty((count, 3)), np.empty((count, 2))
        self._beyond = np.empty(count, np.uint8)
        self._last: tuple[Camera, Float64[np.ndarray, "height width"]] | None = None

    def first_hits(self, camera: Camera, pose: Pose) -> Hits:
        """What the rays of a pinhole `camera` at `pose` = T_world_camera hit, row by row."""
        shape, size = (camera.height, camera.width), np.array([camera.width, camera.height], np.float64)
        project(self._vertices, _projection(camera, pose), size, self._points, self._stands, self._beyond)
        nearest, seen = np.zeros(shape), np.full(shape, -1, np.int32)
        draw(self._faces, self._points, self._stands, self._beyond, nearest, seen)
        weights, distance = np.zeros((*shape, 3), np.float32), np.empty(shape, np.float32)
        weigh(self._faces, self._points, seen, self._lengths(camera), weights, distance)
        return Hits(seen.ravel(), weights.reshape(-1, 3), distance.ravel())

    def _lengths(self, camera: Camera) -> Float64[np.ndarray, "height width"]:
        """How long a ray of each pixel is that goes one metre deep [m]."""
        if self._last is None or self._last[0] != camera:  # a robot looks with one camera all the time
            x = (np.arange(camera.width) + 0.5 - camera.cx) / camera.fx
            y = (np.arange(camera.height) + 0.5 - camera.cy) / camera.fy
            self._last = camera, np.sqrt(x**2 + y[:, None] ** 2 + 1)
        return self._last[1]


@torch.no_grad()
def _projection(camera: Camera, pose: Pose) -> Float64[np.ndarray, "3 4"]:
    """From a point in the world, (x, y, z, 1), to s (u, v, 1), s being its depth [m]."""
    turn = _IMAGE_AXES * pose.rotation.detach().double().cpu().numpy().T
    place = pose.position.detach().double().cpu().numpy()
    intrinsics = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]])
    return intrinsics @ np.column_stack([turn, -turn @ place])
