"""Triangle index: exact tests of which triangles a box touches, with a tree of centres for each size of triangle.

Box and triangle are tested by separating axes (Akenine-Moller, "Fast 3D triangle-box overlap testing", 2001): they are
apart if and only if they are along an axis of the box, the triangle's normal, or a cross product of an axis with an
edge.
"""

from collections.abc import Iterator

import numpy as np
import scipy
from jaxtyping import Bool, Float

from nerfnav.core.jit import kernel

Vector = Float[np.ndarray, " 3"]
Triangles = Float[np.ndarray, "f 3 3"]

_APART = 2.0
"""Boxes within so many half diagonals of each other are tested together: along its path, a robot has the same triangles
near it for some poses."""
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
            (members, reach[members].max(), scipy.spatial.KDTree(centers[members]))
            for members in (np.flatnonzero(size == level) for level in np.unique(size))
        ]

    def near(self, center: Vector, radius: float) -> Triangles:
        """All triangles that come within `radius` [m] of a point, and some that do not."""
        found = [members[tree.query_ball_point(center, radius + reach)] for members, reach, tree in self._levels]
        return self._triangles[np.concatenate([np.zeros(0, int), *found]).astype(int)]

    def touched(
        self, rotations: Float[np.ndarray, "n 3 3"], centers: Float[np.ndarray, "n 3"], half: Vector
    ) -> Bool[np.ndarray, " n"]:
        """Mark boxes of half edges `half` [m], placed by x_world = rotation x + center, that touch any triangle."""
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
    """Mark triangles (corners in the box's frame [m]) that touch the box of half edges `half` around the origin."""
    touched = np.empty(len(corners), bool)
    touch_each(corners, half, touched)
    return touched


@kernel(exact=True)
def _apart(a, b, c, half):
    """Check that three numbers are all on one side of the interval from -`half` to `half`."""
    return min(a, b, c) > half or max(a, b, c) < -half


@kernel(exact=True)
def _apart_across(a, b, c, edge, half):
    """Check for a separating axis across an edge and an axis of the box around the origin, of these half edges."""
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        extent = half[j] * abs(edge[k]) + half[k] * abs(edge[j])
        at_a, at_b = a[k] * edge[j] - a[j] * edge[k], b[k] * edge[j] - b[j] * edge[k]
        if _apart(at_a, at_b, c[k] * edge[j] - c[j] * edge[k], extent):
            return True
    return False


@kernel(exact=True)
def _touch(a, b, c, half):
    """Check that the triangle between three corners touches the box around the origin, of these half edges."""
    for axis in range(3):
        if _apart(a[axis], b[axis], c[axis], half[axis]):
            return False
    ab, bc = (b[0] - a[0], b[1] - a[1], b[2] - a[2]), (c[0] - b[0], c[1] - b[1], c[2] - b[2])
    ca = (a[0] - c[0], a[1] - c[1], a[2] - c[2])
    nx, ny, nz = ab[1] * bc[2] - ab[2] * bc[1], ab[2] * bc[0] - ab[0] * bc[2], ab[0] * bc[1] - ab[1] * bc[0]
    if abs(nx * a[0] + ny * a[1] + nz * a[2]) > half[0] * abs(nx) + half[1] * abs(ny) + half[2] * abs(nz):
        return False
    return not (
        _apart_across(a, b, c, ab, half) or _apart_across(a, b, c, bc, half) or _apart_across(a, b, c, ca, half)
    )


@kernel(exact=True)
def touch_each(triangles, half, touched):
    """Fill `touched` (m): whether each triangle (m, 3, 3) touches the box around the origin, of half edges (3,)."""
    size = (half[0], half[1], half[2])
    for index in range(triangles.shape[0]):
        corners = triangles[index]
        a, b = (corners[0, 0], corners[0, 1], corners[0, 2]), (corners[1, 0], corners[1, 1], corners[1, 2])
        touched[index] = _touch(a, b, (corners[2, 0], corners[2, 1], corners[2, 2]), size)


@kernel(exact=True)
def _seen_from(rotation, center, corner):
    """A point of the world in the axes of a box that stands at x_world = rotation x + center."""
    x, y, z = corner[0] - center[0], corner[1] - center[1], corner[2] - center[2]
    return (
        rotation[0, 0] * x + rotation[1, 0] * y + rotation[2, 0] * z,
        rotation[0, 1] * x + rotation[1, 1] * y + rotation[2, 1] * z,
        rotation[0, 2] * x + rotation[1, 2] * y + rotation[2, 2] * z,
    )


@kernel(exact=True)
def touch_any(triangles, rotations, centers, half, touched):
    """Note in `touched` (n) which boxes of half edges (3,), at x_world = rotation x + center, touch any triangle
    (m, 3, 3)."""
    size = (half[0], half[1], half[2])
    for box in range(centers.shape[0]):
        rotation, center = rotations[box], centers[box]
        for index in range(triangles.shape[0]):
            corners = triangles[index]
            a, b = _seen_from(rotation, center, corners[0]), _seen_from(rotation, center, corners[1])
            if _touch(a, b, _seen_from(rotation, center, corners[2]), size):
                touched[box] = True
                break
