"""Rasteriser: the first hits of all rays of a pinhole camera on a mesh, found together.

The same as asking for each ray alone (nerfnav/world/raycast.py), in a quarter of the time and without the
interpreter's lock.

A point of the mesh is q = K (x, down, forward), and the ray through (u, v) that of all s (u, v, 1), s > 0. With edge
functions in these coordinates (Olano and Greer, Triangle scan conversion using 2D homogeneous coordinates, 1997) a
triangle need not be clipped where it reaches behind the camera: a ray meets it where all three are of one sign, their
shares are the barycentric weights, and one over the depth is linear in u and v.

Nothing is reordered or fused: neighbours then disagree in nothing about the edge between them but the sign, so that
no ray slips through.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import torch
import trimesh
from jaxtyping import Float32, Float64, Int32

from nerfnav.core.jit import kernel
from nerfnav.geometry import Camera, Pose


@dataclass(frozen=True)
class Hits:
    """First hits of n rays on a mesh."""

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
        """Take the positions of `mesh` in single precision, as all renderers do."""
        self._vertices = np.ascontiguousarray(mesh.vertices, np.float32)
        self._faces = np.ascontiguousarray(mesh.faces, np.int32)
        count = len(self._vertices)
        self._points, self._stands = np.empty((count, 3)), np.empty((count, 2))
        self._beyond = np.empty(count, np.uint8)

    def first_hits(self, camera: Camera, pose: Pose) -> Hits:
        """Find the first hits of all rays of a pinhole `camera` at `pose` = T_world_camera, row by row."""
        shape, size = (camera.height, camera.width), np.array([camera.width, camera.height], np.float64)
        project(self._vertices, _projection(camera, pose), size, self._points, self._stands, self._beyond)
        nearest, seen = np.zeros(shape), np.full(shape, -1, np.int32)
        draw(self._faces, self._points, self._stands, self._beyond, nearest, seen)
        weights, distance = np.zeros((*shape, 3), np.float32), np.empty(shape, np.float32)
        weigh(self._faces, self._points, seen, _ray_lengths(camera), weights, distance)
        return Hits(seen.ravel(), weights.reshape(-1, 3), distance.ravel())


@lru_cache(maxsize=4)  # a robot looks with one camera all the time
def _ray_lengths(camera: Camera) -> Float64[np.ndarray, "height width"]:
    """Length of the ray of each pixel to a depth of one metre [m]."""
    x = (np.arange(camera.width) + 0.5 - camera.cx) / camera.fx
    y = (np.arange(camera.height) + 0.5 - camera.cy) / camera.fy
    return np.sqrt(x**2 + y[:, None] ** 2 + 1)


@torch.no_grad()
def _projection(camera: Camera, pose: Pose) -> Float64[np.ndarray, "3 4"]:
    """From a point in the world, (x, y, z, 1), to s (u, v, 1), s being its depth [m]."""
    turn = _IMAGE_AXES * pose.rotation.detach().double().cpu().numpy().T
    place = pose.position.detach().double().cpu().numpy()
    intrinsics = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]])
    return intrinsics @ np.column_stack([turn, -turn @ place])


_BEHIND = 16
_NARROW = 8  # pixels: narrower triangles are tested at each pixel of a row, of wider ones the ends are found first


@kernel(exact=True)
def project(vertices, matrix, size, points, stands, beyond):
    """Fill `points` (n, 3), q of the vertices (n, 3) by the matrix (3, 4); where they stand in the picture (n, 2)
    [pixels], if they are before the camera; and bits that say on the wrong side of which limits of sight they are,
    `size` being width and height [pixels]."""
    for i in range(vertices.shape[0]):
        x, y, z = np.float64(vertices[i, 0]), np.float64(vertices[i, 1]), np.float64(vertices[i, 2])
        a = matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2] * z + matrix[0, 3]
        b = matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2] * z + matrix[1, 3]
        c = matrix[2, 0] * x + matrix[2, 1] * y + matrix[2, 2] * z + matrix[2, 3]
        points[i, 0], points[i, 1], points[i, 2] = a, b, c
        stands[i, 0], stands[i, 1] = a / c, b / c
        across = (a < 0) | ((a > size[0] * c) << 1) | ((b < 0) << 2) | ((b > size[1] * c) << 3)
        beyond[i] = across | ((c <= 0) << 4)


@kernel(exact=True)
def _edges(a, b, c):
    """Edge functions (3 x 3, row by row) of a triangle between the points a, b, c, and its determinant."""
    ux, uy, uz = b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]
    vx, vy, vz = c[1] * a[2] - c[2] * a[1], c[2] * a[0] - c[0] * a[2], c[0] * a[1] - c[1] * a[0]
    wx, wy, wz = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    det = a[0] * ux + a[1] * uy + a[2] * uz
    if det < 0:  # seen from its other side
        ux, uy, uz, vx, vy, vz = -ux, -uy, -uz, -vx, -vy, -vz
        wx, wy, wz, det = -wx, -wy, -wz, -det
    return ux, uy, uz, vx, vy, vz, wx, wy, wz, det


@kernel(exact=True)
def _range(a, b, c, count):
    """First and last of `count` pixels between three coordinates, a little more than those that are strictly within."""
    least, most = max(min(a, b, c) - 0.501, 0.0), min(max(a, b, c) - 0.499, count - 1.0)
    return (np.int64(np.ceil(least)), np.int64(np.floor(most))) if least <= most else (1, 0)


@kernel(exact=True)
def _narrowed(first, last, slope, offset):
    """Those pixels of a row, from `first` to `last`, at which an edge function may be positive, and a few more."""
    if slope == 0:
        return (first, last) if offset >= 0 else (1, 0)
    root = min(max(-offset / slope, -4.0), last + 4.0)
    if slope > 0:
        return max(first, np.int64(np.floor(root)) - 1), last
    return first, min(last, np.int64(np.ceil(root)))


@kernel(exact=True)
def draw(faces, points, stands, beyond, nearest, seen):
    """Note in `seen` (height, width) which of the faces (f, 3) each pixel's ray meets first, and in `nearest` one over
    its depth [1/m]; both are overwritten where something nearer is met."""
    height, width = nearest.shape
    for face in range(faces.shape[0]):
        i, j, k = faces[face, 0], faces[face, 1], faces[face, 2]
        if beyond[i] & beyond[j] & beyond[k]:
            continue
        left, right, top, bottom = 0, width - 1, 0, height - 1
        if not (beyond[i] | beyond[j] | beyond[k]) & _BEHIND:
            left, right = _range(stands[i, 0], stands[j, 0], stands[k, 0], width)
            top, bottom = _range(stands[i, 1], stands[j, 1], stands[k, 1], height)
        if left > right or top > bottom:
            continue
        ux, uy, uz, vx, vy, vz, wx, wy, wz, det = _edges(points[i], points[j], points[k])
        if det == 0:
            continue
        nx, ny, nz = (ux + vx + wx) / det, (uy + vy + wy) / det, (uz + vz + wz) / det
        for row in range(top, bottom + 1):
            y = row + 0.5
            u, v, w, n = uy * y + uz, vy * y + vz, wy * y + wz, ny * y + nz
            first, last = left, right
            if right - left > _NARROW:
                first, last = _narrowed(first, last, ux, u)
                first, last = _narrowed(first, last, vx, v)
                first, last = _narrowed(first, last, wx, w)
            for column in range(first, last + 1):
                x = column + 0.5
                near = nx * x + n
                if near > nearest[row, column] and ux * x + u >= 0 and vx * x + v >= 0 and wx * x + w >= 0:
                    nearest[row, column], seen[row, column] = near, face


@kernel(exact=True)
def weigh(faces, points, seen, lengths, weights, distance):
    """Fill the barycentric weights (height, width, 3) of the faces that are `seen` (-1: none), and the distance to them
    [m]; `lengths` (height, width) are those of rays one metre deep. Nothing seen is infinitely far."""
    last = -1
    ux, uy, uz, vx, vy, vz, wx, wy, wz, det = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for row in range(seen.shape[0]):
        y = row + 0.5
        for column in range(seen.shape[1]):
            face = seen[row, column]
            if face < 0:
                distance[row, column] = np.inf
                continue
            if face != last:
                i, j, k = faces[face, 0], faces[face, 1], faces[face, 2]
                ux, uy, uz, vx, vy, vz, wx, wy, wz, det = _edges(points[i], points[j], points[k])
                last = face
            x = column + 0.5
            u, v, w = ux * x + (uy * y + uz), vx * x + (vy * y + vz), wx * x + (wy * y + wz)
            total = u + v + w
            weights[row, column, 0], weights[row, column, 1], weights[row, column, 2] = u / total, v / total, w / total
            distance[row, column] = det / total * lengths[row, column]
