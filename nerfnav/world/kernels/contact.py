"""Box-triangle overlap test by separating axes.

Akenine-Moller, "Fast 3D triangle-box overlap testing", 2001. A box and a triangle are apart if and only if they are
along an axis of the box, the triangle's normal, or a cross product of an axis with an edge.
"""

from nerfnav.core.jit import kernel


@kernel(inline=True, exact=True)
def _apart(a, b, c, half):
    """Whether three numbers are all on one side of all that is within `half` of 0."""
    return min(a, b, c) > half or max(a, b, c) < -half


@kernel(inline=True, exact=True)
def _apart_across(a, b, c, edge, half):
    """Whether an axis apart lies across an edge and an axis of the box around the origin, of these half edges."""
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        extent = half[j] * abs(edge[k]) + half[k] * abs(edge[j])
        at_a, at_b = a[k] * edge[j] - a[j] * edge[k], b[k] * edge[j] - b[j] * edge[k]
        if _apart(at_a, at_b, c[k] * edge[j] - c[j] * edge[k], extent):
            return True
    return False


@kernel(inline=True, exact=True)
def _touch(a, b, c, half):
    """Whether the triangle between three corners touches the box around the origin, of these half edges."""
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


@kernel(inline=True, exact=True)
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
