"""Shapes that places are built from: finely tessellated, watertight, free of self-intersections.

Every shape is a box or a disk bent by maps that are one to one, so it cannot cut through itself.
"""

from dataclasses import dataclass

import numpy as np
import trimesh
from scipy.spatial import Delaunay

from scenes.noise import noise

Size = tuple[float, float, float]


@dataclass(frozen=True)
class Roughness:
    """How uneven a stone is."""

    rounding: float = 0.014
    """Radius of its edges [m]."""
    taper: float = 0.12
    """Share by which its top is narrower than its foot."""
    bulge: float = 0.0065
    """Height of bumps about 9 cm wide [m]."""
    grain: float = 0.003
    """Height of bumps about 3 cm wide [m]."""


def box(size: Size, edge: float) -> trimesh.Trimesh:
    """A box around the origin whose triangles' legs are `edge` [m] or a little shorter."""
    counts = np.maximum(1, np.ceil(np.array(size) / edge).astype(int))
    corners = np.concatenate([_side(counts, axis, far) for axis in range(3) for far in (False, True)])
    strides = np.array([1, counts[0] + 1, (counts[0] + 1) * (counts[1] + 1)])
    _, first, index = np.unique(corners @ strides, return_index=True, return_inverse=True)
    vertices = (corners[first] / counts - 0.5) * size
    quads = index.reshape(-1, 4)
    return trimesh.Trimesh(vertices, quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3), process=False)


def _side(counts: np.ndarray, axis: int, far: bool) -> np.ndarray:
    """Lattice corners (4 q, 3) of one side's quads, counter-clockwise as seen from outside."""
    u, v = (axis + 1) % 3, (axis + 2) % 3
    i, j = (a.ravel() for a in np.meshgrid(np.arange(counts[u]), np.arange(counts[v]), indexing="ij"))
    ring = [(0, 0), (1, 0), (1, 1), (0, 1)] if far else [(0, 0), (0, 1), (1, 1), (1, 0)]
    corners = np.empty((len(i), 4, 3), int)
    corners[..., axis] = counts[axis] if far else 0
    for k, (right, up) in enumerate(ring):
        corners[:, k, u], corners[:, k, v] = i + right, j + up
    return corners.reshape(-1, 3)


def stone(size: Size, edge: float, seed: int, roughness: Roughness | None = None) -> trimesh.Trimesh:
    """A weathered block that stands on the plane z = 0, about as large as `size` [m]."""
    rough = roughness or Roughness()
    mesh = box(size, edge)
    half = np.array(size) / 2
    radius = min(rough.rounding, 0.9 * half.min())
    core = np.clip(mesh.vertices, radius - half, half - radius)
    outward = mesh.vertices - core
    points = core + radius * outward / np.linalg.norm(outward, axis=1, keepdims=True)
    points[:, :2] *= 1 - rough.taper * (points[:, 2:] / size[2] + 0.5)
    mesh.vertices = points + _wobble(points, rough, seed) + [0, 0, half[2]]
    return mesh


def _wobble(points: np.ndarray, rough: Roughness, seed: int) -> np.ndarray:
    """A displacement (n, 3) that changes by less than 1 m per metre: adding it keeps a surface simple."""
    spread = points + 7.3 * seed
    bulge = np.stack([noise(spread, 0.09, k) for k in range(3)], -1)
    grain = np.stack([noise(spread, 0.03, 3 + k) for k in range(3)], -1)
    return rough.bulge * bulge + rough.grain * grain


def disk(radius: float, thickness: float, edge: float) -> trimesh.Trimesh:
    """A flat disk, its top at z = 0, with a rim `thickness` [m] deep and a coarse underside."""
    rings = int(np.ceil(radius / edge))
    below = int(np.ceil(thickness / edge))
    points = [np.zeros((1, 2))]
    for k in range(1, rings + below + 1):
        turn = 2 * np.pi * (np.arange(6 * min(k, rings)) + 0.5 * (k % 2)) / (6 * min(k, rings))
        points.append(k * np.stack([np.cos(turn), np.sin(turn)], -1))
    flat = np.concatenate(points)
    faces = Delaunay(flat).simplices
    reach = np.linalg.norm(flat, axis=1)
    # rings beyond the radius are folded down to make the rim
    vertices = np.zeros((len(flat) + 1, 3))
    vertices[:-1, :2] = flat * (radius / rings * np.minimum(1, rings / np.maximum(reach, 1e-9)))[:, None]
    vertices[:-1, 2] = -thickness * np.maximum(0, reach - rings) / below
    vertices[-1, 2] = -thickness
    last = np.arange(len(flat) - 6 * rings, len(flat))
    under = np.stack([np.full_like(last, len(flat)), np.roll(last, -1), last], -1)
    clockwise = _turns_right(flat[faces])
    faces[clockwise] = faces[clockwise][:, ::-1]
    return trimesh.Trimesh(vertices, np.concatenate([faces, under]), process=False)


def _turns_right(triangles: np.ndarray) -> np.ndarray:
    """Which triangles (f, 3, 2) of the plane run clockwise."""
    along, across = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    return along[:, 0] * across[:, 1] < along[:, 1] * across[:, 0]


def place(mesh: trimesh.Trimesh, position: Size, yaw: float, tilt: tuple[float, float] = (0.0, 0.0)) -> trimesh.Trimesh:
    """The shape turned about its y and x axes by `tilt`, then about z by `yaw` [rad], and moved [m]."""
    lean = trimesh.transformations.euler_matrix(tilt[1], tilt[0], yaw, axes="sxyz")
    lean[:3, 3] = position
    return mesh.apply_transform(lean)
