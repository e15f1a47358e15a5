"""A ball between triangles: whether it fits, for planners that know a field only as a mesh."""

from typing import TYPE_CHECKING

import numpy as np
import scipy

if TYPE_CHECKING:
    import trimesh


class BallCheck:
    """Whether a ball of one radius is clear of a closed mesh whose triangles face outwards.

    The nearest triangle's middle decides nearly always; the few balls that are about as near as triangles are large
    are measured against the triangles themselves.
    """

    def __init__(self, mesh: "trimesh.Trimesh", radius: float) -> None:
        """Index a mesh, which may be empty, for balls of `radius` [m]."""
        self.radius = radius
        self._triangles = np.asarray(mesh.triangles, dtype=np.float64)
        self._tree = None
        if len(self._triangles):
            self._centers = self._triangles.mean(1)
            self._normals = np.cross(*np.moveaxis(self._triangles[:, 1:] - self._triangles[:, :1], 1, 0))
            self._reach = float(np.linalg.norm(self._triangles - self._centers[:, None], axis=-1).max())
            self._tree = scipy.spatial.KDTree(self._centers)

    def fits(self, point: np.ndarray) -> bool:
        """Whether the ball at `point` (3,) [m] is outside of the mesh and clear of every triangle."""
        if self._tree is None:
            return True
        distance, nearest = self._tree.query(point)
        if distance <= self.radius:
            return False
        if distance > self.radius + self._reach:
            return bool((point - self._centers[nearest]) @ self._normals[nearest] > 0)
        import trimesh  # seldom needed, and slow to import

        near = self._tree.query_ball_point(point, distance + self._reach)
        away = point - trimesh.triangles.closest_point(self._triangles[near], np.tile(point, (len(near), 1)))
        apart = np.linalg.norm(away, axis=-1)
        # several triangles share the closest edge or corner: the one that the point faces most squarely knows the side
        closest = np.flatnonzero(apart <= apart.min() + 1e-9)
        facing = np.einsum("na,na->n", away[closest], self._normals[near][closest])
        return bool(apart.min() > self.radius and facing[np.abs(facing).argmax()] > 0)
