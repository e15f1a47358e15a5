"""Triangle index: exact tests of which triangles a box touches, with a tree of centres for each size of triangle."""

from collections.abc import Iterator

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial import KDTree

from nerfnav.world.kernels.contact import touch_any, touch_each

Vector = Float[np.ndarray, " 3"]
Triangles = Float[np.ndarray, "f 3 3"]

_APART = 2.0
"""Boxes that are so many half diagonals from each other are asked about together: on its way, a robot has the same near
it for some poses."""
_AT_ONCE = 256


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
        touched, reach = np.zeros(len(centers), bool), float(np.linalg.norm(half))
        for some in _side_by_side(centers, _APART * reach):
            middle = centers[some].mean(0)
            radius = np.linalg.norm(centers[some] - middle, axis=1).max() + reach
            touch_any(self.near(middle, radius), rotations[some], centers[some], half, touched[some])
        return touched


def _side_by_side(centers: Float[np.ndarray, "n 3"], within: float) -> Iterator[slice]:
    """Those after each other of which none is farther from the first than this [m]: what is near one is near all."""
    start = 0
    while start < len(centers):
        off = np.linalg.norm(centers[start : start + _AT_ONCE] - centers[start], axis=1) > within
        count = int(off.argmax()) if off.any() else len(off)
        yield slice(start, start + count)
        start += count


def boxes_touch_triangles(corners: Float[np.ndarray, "m 3 3"], half: Vector) -> Bool[np.ndarray, " m"]:
    """Whether triangles (corners in the box's frame [m]) touch the box of half edges `half` around the origin."""
    touched = np.empty(len(corners), bool)
    touch_each(corners, half, touched)
    return touched
