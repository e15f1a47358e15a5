"""Which triangles a box touches, exactly.

Separating axes: Akenine-Moller, "Fast 3D triangle-box overlap testing", 2001.
"""

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial import KDTree

Vector = Float[np.ndarray, " 3"]
Triangles = Float[np.ndarray, "f 3 3"]

_BOXES_AT_ONCE = 256


class TriangleIndex:
    """Tells which boxes touch any of many triangles: one tree of centres for each size of triangle."""

    def __init__(self, triangles: Triangles) -> None:
        """Sort triangles [m] by size, so that a search reaches no further than the largest of its size."""
        self._triangles = triangles
        centers = triangles.mean(1)
        reach = np.linalg.norm(triangles - centers[:, None], axis=-1).max(1)
        size = np.floor(np.log2(np.maximum(reach, 1e-9))).astype(int)
        self._levels = [
            (members, reach[members].max(), KDTree(centers[members]))
            for members in (np.flatnonzero(size == level) for level in np.unique(size))
        ]

    def near(self, center: Vector, radius: float) -> Triangles:
        """All triangles that come within `radius` [m] of a point, and some that do not."""
        found = [members[tree.query_ball_point(center, radius + reach)] for members, reach, tree in self._levels]
        return self._triangles[np.concatenate([np.zeros(0, int), *found]).astype(int)]

    def touched(
        self, rotations: Float[np.ndarray, "n 3 3"], centers: Float[np.ndarray, "n 3"], half: Vector
    ) -> Bool[np.ndarray, " n"]:
        """Whether each box of half edges `half` [m], placed by x_world = rotation x + center, touches any triangle."""
        touched = np.zeros(len(centers), bool)
        radius = float(np.linalg.norm(half))
        for members, reach, tree in self._levels:
            nearest = tree.query(centers, distance_upper_bound=np.nextafter(radius + reach, np.inf))[0]
            touched |= nearest <= half.min()  # a centre of a triangle inside the box's inner ball settles it at once
            left = np.flatnonzero(~touched & (nearest < np.inf))
            for open_ in np.array_split(left, 1 + len(left) // _BOXES_AT_ONCE) if len(left) else ():
                near = tree.query_ball_point(centers[open_], radius + reach)
                box = np.repeat(open_, [len(found) for found in near])
                face = members[np.concatenate([np.zeros(0, int), *near]).astype(int)]
                offset = self._triangles[face] - centers[box, None]
                corners = np.einsum("mij,mki->mkj", rotations[box], offset)
                touched[box[boxes_touch_triangles(corners, half)]] = True
        return touched


def boxes_touch_triangles(corners: Float[np.ndarray, "m 3 3"], half: Vector) -> Bool[np.ndarray, " m"]:
    """Whether triangles (corners in the box's frame [m]) touch the box of half edges `half` around the origin."""
    touch = ((corners.min(1) <= half) & (corners.max(1) >= -half)).all(-1)
    left = corners[touch]
    if not len(left):
        return touch
    edges = np.roll(left, -1, axis=1) - left
    normal = np.cross(edges[:, 0], edges[:, 1])
    within = np.abs((normal * left[:, 0]).sum(-1)) <= np.abs(normal) @ half
    axes = np.cross(np.eye(3)[None, :, None], edges[:, None]).reshape(-1, 9, 3)
    along = np.einsum("mad,mkd->mak", axes, left)
    extent = np.abs(axes) @ half
    within &= ((along.min(-1) <= extent) & (along.max(-1) >= -extent)).all(-1)
    touch[touch] = within
    return touch
