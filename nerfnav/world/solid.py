"""Solids: the volume that a body shares with them, and tests of points inside.

Volumes are exact for watertight solids (booleans). For meshes that bound no volume they are the share of the body's
cells whose middles have a generalised winding number above one half, times the body's volume (Jacobson, Kavan,
Sorkine-Hornung, "Robust inside-outside segmentation using generalized winding numbers", 2013).
"""

import math
from collections.abc import Sequence
from functools import cached_property

import numpy as np
import trimesh
from jaxtyping import Bool, Float
from manifold3d import Manifold

from nerfnav.core.jit import kernel
from nerfnav.world.body_volume import BodyVolume, manifold_of
from nerfnav.world.raycast import RayCaster
from nerfnav.world.triangle_index import Triangles, Vector

Points = Float[np.ndarray, "n 3"]

_UPWARDS = np.array([0.0131, 0.0073, 0.9999], np.float32)  # not along any axis: no ray runs inside a face


class Solid:
    """One solid for contact; expensive structures are built when they are first needed."""

    def __init__(self, mesh: trimesh.Trimesh) -> None:
        """Take a mesh as a solid, watertight or not."""
        self.mesh = mesh
        self.lower, self.upper = np.asarray(mesh.bounds, float)

    @cached_property
    def manifold(self) -> Manifold | None:
        """The solid for booleans; None where the mesh bounds no volume."""
        return manifold_of(np.asarray(self.mesh.vertices), np.asarray(self.mesh.faces))

    @cached_property
    def _caster(self) -> RayCaster:
        return RayCaster(self.mesh)

    def contains(self, points: Points) -> Bool[np.ndarray, " n"]:
        """Mark the points [m] that lie inside."""
        inside = ((points >= self.lower) & (points <= self.upper)).all(-1)
        if inside.any():
            found = points[inside]
            if self.manifold is not None:
                inside[inside] = self._leaves_first(found)
            else:
                inside[inside] = np.abs(winding_number(self.mesh.triangles, found)) > 0.5
        return inside

    def _leaves_first(self, points: Points) -> Bool[np.ndarray, " n"]:
        """Mark points that see the first face above them from behind, as only points inside do."""
        directions = np.tile(_UPWARDS, (len(points), 1))
        face = self._caster.first_hits(points.astype(np.float32), directions).face
        return (face >= 0) & (self.mesh.face_normals[face] @ _UPWARDS > 0)


def overlap_volume(
    solids: Sequence[Solid], body: BodyVolume, rotation: Float[np.ndarray, "3 3"], center: Vector
) -> float:
    """Volume [m^3] that a body of pose x_world = rotation x + center shares with the union of solids.

    The solids may overlap one another.
    """
    reach = np.abs(rotation) @ body.half
    lower, upper = center - reach, center + reach
    near = [solid for solid in solids if (solid.lower <= upper).all() and (solid.upper >= lower).all()]
    left = body.manifold.transform(np.column_stack([rotation, center]))
    closed = [(solid, solid.manifold) for solid in near if solid.manifold is not None]
    leaky = [solid for solid in near if solid.manifold is None]
    volume = 0.0
    for _, manifold in closed:
        inside, left = left.split(manifold)
        volume += inside.volume()
    if leaky:
        points = body.middles @ rotation.T + center
        counted = np.any([solid.contains(points) for solid in leaky], axis=0)
        for solid, _ in closed:  # what these hold is counted already
            counted &= ~solid.contains(points)
        volume += counted.sum() * body.cell_volume
    return float(volume)


def winding_number(triangles: Triangles, points: Points) -> Float[np.ndarray, " n"]:
    """Winding number of a surface around each point: 1 inside a closed one, 0 outside.

    Solid angles over 4 pi, each by Van Oosterom and Strackee, "The solid angle of a plane triangle", 1983.
    """
    total = np.zeros(len(points))
    add_solid_angles(np.ascontiguousarray(triangles, float), np.ascontiguousarray(points, float), total)
    return total / (4 * np.pi)


@kernel(exact=True)
def add_solid_angles(triangles, points, total):
    """Add to `total` (n) the solid angles of triangles (m, 3, 3) at points (n, 3)."""
    for point in range(points.shape[0]):
        x, y, z = points[point, 0], points[point, 1], points[point, 2]
        for face in range(triangles.shape[0]):
            t = triangles[face]
            ax, ay, az = t[0, 0] - x, t[0, 1] - y, t[0, 2] - z
            bx, by, bz = t[1, 0] - x, t[1, 1] - y, t[1, 2] - z
            cx, cy, cz = t[2, 0] - x, t[2, 1] - y, t[2, 2] - z
            la = math.sqrt(ax * ax + ay * ay + az * az)
            lb = math.sqrt(bx * bx + by * by + bz * bz)
            lc = math.sqrt(cx * cx + cy * cy + cz * cz)
            triple = ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
            rest = la * lb * lc + (ax * bx + ay * by + az * bz) * lc
            rest += (bx * cx + by * cy + bz * cz) * la + (cx * ax + cy * ay + cz * az) * lb
            total[point] += 2.0 * math.atan2(triple, rest)
