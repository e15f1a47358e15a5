"""Shapes that places are built from: finely tessellated, watertight, free of self-intersections.

Every shape is a box, a disk or a ring bent by maps that are one to one, so it cannot cut through itself.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import trimesh
from manifold3d import Manifold, Mesh64, OpType
from scipy.spatial import Delaunay

from nerfnav_scenes.noise import noise

Size = tuple[float, float, float]
Curve = Callable[[np.ndarray], np.ndarray]
"""Numbers (n,) to numbers (n,), all in metres."""
EDGE = 0.0135
"""Legs of the triangles: the finest detail that colours of places about 3 m long can have [m]."""


@dataclass(frozen=True)
class Roughness:
    """Roughness of the surface of a stone."""

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
    return _mesh_of_quads(vertices, index.reshape(-1, 4))


def _mesh_of_quads(vertices: np.ndarray, quads: np.ndarray) -> trimesh.Trimesh:
    """Mesh of quadrangles (q, 4), each cut into two triangles."""
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


def turned(height: float, radius: Curve, edge: float) -> trimesh.Trimesh:
    """Solid of revolution that stands on z = 0, with `radius` [m] of its heights, all above 0."""
    width = 2 * float(np.max(radius(np.linspace(0, height, 50))))
    mesh = box((width, width, height), edge)
    points = mesh.vertices.copy()
    points[:, 2] += height / 2
    square = np.abs(points[:, :2]).max(1)
    reach = np.linalg.norm(points[:, :2], axis=1)
    # squares around the axis become circles
    points[:, :2] *= (square / np.maximum(reach, 1e-12) * radius(points[:, 2]) / (width / 2))[:, None]
    mesh.vertices = points
    return mesh


def bar(start: Size, end: Size, radius: float, edge: float) -> trimesh.Trimesh:
    """A round bar from one point to another [m]."""
    way = np.subtract(end, start)
    mesh = turned(float(np.linalg.norm(way)), lambda z: np.full_like(z, radius), edge)
    mesh.apply_transform(trimesh.geometry.align_vectors([0, 0, 1], way))
    return mesh.apply_translation(start)


def ring(profile: np.ndarray, edge: float) -> trimesh.Trimesh:
    """A closed profile (k, 2) of radius and height [m], counter-clockwise, swept once around the z axis."""
    loop = np.concatenate([
        a + np.linspace(0, 1, max(1, int(np.ceil(np.linalg.norm(b - a) / edge))), endpoint=False)[:, None] * (b - a)
        for a, b in zip(profile, np.roll(profile, -1, axis=0), strict=True)
    ])  # fmt: skip
    around, along = max(12, int(np.ceil(2 * np.pi * loop[:, 0].max() / edge))), len(loop)
    turn = (2 * np.pi * np.arange(around) / around)[:, None]
    points = [loop[:, 0] * np.cos(turn), loop[:, 0] * np.sin(turn), np.broadcast_to(loop[:, 1], (around, along))]
    i, j = (a.ravel() for a in np.meshgrid(np.arange(around), np.arange(along), indexing="ij"))
    here, there, up = i * along, (i + 1) % around * along, (j + 1) % along
    quads = np.stack([here + j, there + j, there + up, here + up], -1)
    return _mesh_of_quads(np.stack(points, -1).reshape(-1, 3), quads)


def panel(ends: tuple[float, float], depth: float, low: Curve, high: Curve, edge: float) -> trimesh.Trimesh:
    """An upright wall of `depth` [m] across y, from x = ends[0] to ends[1], whose edges run at z = low(x), high(x).

    `low` must be below `high` everywhere: arches are walls with a bent lower edge, gables have a bent upper one.
    """
    width = ends[1] - ends[0]
    along = np.linspace(*ends, 50)
    height = float(np.max(high(along) - low(along)))
    mesh = box((width, depth, height), edge)
    points = mesh.vertices.copy()
    # more columns near the ends, where arches are steep
    points[:, 0] = ends[0] + width / 2 * (1 + np.sin(np.pi * points[:, 0] / width))
    share = points[:, 2] / height + 0.5
    points[:, 2] = (1 - share) * low(points[:, 0]) + share * high(points[:, 0])
    mesh.vertices = points
    return mesh


def fused(pieces: Sequence[trimesh.Trimesh]) -> trimesh.Trimesh:
    """One solid of several that overlap, without the surfaces inside it."""
    return _combined(pieces, OpType.Add)


def cut(body: trimesh.Trimesh, holes: Sequence[trimesh.Trimesh]) -> trimesh.Trimesh:
    """Cut solids out of another one."""
    return _combined([body, *holes], OpType.Subtract)


def _combined(pieces: Sequence[trimesh.Trimesh], operation: OpType) -> trimesh.Trimesh:
    solids = [Manifold(Mesh64(np.asarray(one.vertices, float), np.asarray(one.faces, np.uint64))) for one in pieces]
    mesh = Manifold.batch_boolean(solids, operation).to_mesh64()
    return trimesh.Trimesh(mesh.vert_properties[:, :3], mesh.tri_verts, process=False)


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
    """Mark triangles (f, 3, 2) of the plane that run clockwise."""
    along, across = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    return along[:, 0] * across[:, 1] < along[:, 1] * across[:, 0]


def place(mesh: trimesh.Trimesh, position: Size, yaw: float, tilt: tuple[float, float] = (0.0, 0.0)) -> trimesh.Trimesh:
    """The shape turned about its y and x axes by `tilt`, then about z by `yaw` [rad], and moved [m]."""
    lean = trimesh.transformations.euler_matrix(tilt[1], tilt[0], yaw, axes="sxyz")
    lean[:3, 3] = position
    return mesh.apply_transform(lean)
