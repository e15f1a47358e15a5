"""The penalty on reaching beyond the field's box with its derivative: twin of `outside` in planner/space/border.py."""

import math

from nerfnav.core.jit import kernel

SMOOTH = 1e-4
"""Added to the square of what a unit vector has along an axis, so that its absolute value has no kink."""


@kernel()
def outside(position, rotation, space, weight, by_position, by_rotation):
    """`weight` times the penalty; adds its derivatives by position and attitude (in its tangent).

    `space` is (lower and upper corner of the box, half edges of the body).
    """
    lower, upper, half = space
    farthest, total = (half[0] + half[1] + half[2]) * math.sqrt(1.0 + SMOOTH), 0.0
    for t in range(rotation.shape[0]):
        for axis in range(3):
            at = position[t, axis]
            if lower[axis] + farthest <= at <= upper[axis] - farthest:
                continue
            x, y, z = rotation[t, axis, 0], rotation[t, axis, 1], rotation[t, axis, 2]
            along_x, along_y, along_z = math.sqrt(x * x + SMOOTH), math.sqrt(y * y + SMOOTH), math.sqrt(z * z + SMOOTH)
            reach = half[0] * along_x + half[1] * along_y + half[2] * along_z
            below, above = max(lower[axis] - at + reach, 0.0), max(at + reach - upper[axis], 0.0)
            total += weight * (below * below + above * above)
            by_position[t, axis] += 2.0 * weight * (above - below)
            pull = 2.0 * weight * (above + below)
            by_x, by_y, by_z = half[0] * x / along_x, half[1] * y / along_y, half[2] * z / along_z
            by_rotation[t, 0] += pull * (z * by_y - y * by_z)
            by_rotation[t, 1] += pull * (x * by_z - z * by_x)
            by_rotation[t, 2] += pull * (y * by_x - x * by_y)
    return total
