"""Signed distance of points from a closed mesh: the nearest of its triangles, in a tree of pieces of one size.

Triangles are divided until all of a piece is within some length of its middle. Of the pieces whose middles are within
the distance of the nearest middle plus that length, one holds the nearest point.
"""

import numpy as np
import scipy
import trimesh
from jaxtyping import Float

from nerfnav.robots.surface import divide_until, radii_of
from nerfnav.world import Solid

_PIECES = 48
"""Size of a mesh in radii of its pieces, at least."""
_AT_ONCE = 4096
"""Points that are compared with pieces together."""


class MeshDistance:
    """Distances from one closed mesh."""

    def __init__(self, mesh: trimesh.Trimesh) -> None:
        """Divide the triangles of a mesh [m], whose faces may look inwards."""
        mesh = mesh.copy()
        if mesh.volume < 0:
            mesh.invert()
        largest = float(mesh.extents.max()) / _PIECES
        self._pieces = divide_until(np.asarray(mesh.triangles, float), radii_of, largest)
        self._radius = float(radii_of(self._pieces).max())
        self._tree = scipy.spatial.KDTree(self._pieces.mean(1))
        self._solid = Solid(mesh)

    def signed(self, points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, " n"]:
        """Distances of points from the surface [m], negative inside."""
        found = np.empty(len(points))
        for start in range(0, len(points), _AT_ONCE):
            some = points[start : start + _AT_ONCE]
            nearest, _ = self._tree.query(some)
            near = self._tree.query_ball_point(some, nearest + self._radius * (1 + 1e-9))
            counts = np.array([len(each) for each in near])
            pieces = self._pieces[np.concatenate(near).astype(int)]
            closest = trimesh.triangles.closest_point(pieces, np.repeat(some, counts, axis=0))
            distance = np.linalg.norm(closest - np.repeat(some, counts, axis=0), axis=1)
            found[start : start + _AT_ONCE] = np.minimum.reduceat(distance, np.cumsum(counts) - counts)
        return np.where(self._solid.contains(points), -found, found)
