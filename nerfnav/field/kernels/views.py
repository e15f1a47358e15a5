"""Node visibility: project the nodes of a grid into a camera, for kernels that ask each picture about every node.

Nodes are taken in cubes of `SIDE`^3, so that most of those that a camera does not see cost nothing. A node stands for
a window of pixels, the smallest of some sizes that reaches a voxel to each side of it.
"""

import math

import numpy as np

from nerfnav.core.jit import kernel

SIDE = 8
"""Nodes along each edge of a cube."""


@kernel()
def cube_of(index, shape):
    """First nodes (x, y, z) of a cube, counted z fastest."""
    across, deep = (shape[1] + SIDE - 1) // SIDE, (shape[2] + SIDE - 1) // SIDE
    return SIDE * (index // (across * deep)), SIDE * (index // deep % across), SIDE * (index % deep)


@kernel()
def cube_count(shape):
    """Number of cubes in a grid."""
    side = SIDE
    return ((shape[0] + side - 1) // side) * ((shape[1] + side - 1) // side) * ((shape[2] + side - 1) // side)


@kernel()
def in_camera(x, y, z, rotation, position):
    """A world point in the camera's frame: right, down, ahead [m]."""
    x, y, z = x - position[0], y - position[1], z - position[2]
    right = rotation[0, 0] * x + rotation[1, 0] * y + rotation[2, 0] * z
    up = rotation[0, 1] * x + rotation[1, 1] * y + rotation[2, 1] * z
    back = rotation[0, 2] * x + rotation[1, 2] * y + rotation[2, 2] * z
    return right, -up, -back


@kernel()
def may_show(right, down, ahead, radius, lens, width, height):
    """Check that any of a ball around a point in the camera's frame may be in the picture; `lens` = fx, fy, cx, cy."""
    if ahead < -radius:
        return False
    one = np.float32(1.0)
    east, west = (np.float32(width) - lens[2]) / lens[0], lens[2] / lens[0]
    south, north = (np.float32(height) - lens[3]) / lens[1], lens[3] / lens[1]
    inside = right <= ahead * east + radius * math.sqrt(one + east * east)
    inside = inside and -right <= ahead * west + radius * math.sqrt(one + west * west)
    inside = inside and down <= ahead * south + radius * math.sqrt(one + south * south)
    return inside and -down <= ahead * north + radius * math.sqrt(one + north * north)


@kernel()
def cube_in_view(cube, lower, spacing, shape, view, width, height):
    """First nodes (x, y, z) of a cube, and whether a `view` (rotation, position, lens) may show any of it."""
    rotation, position, lens = view
    half = np.float32(0.5 * (SIDE - 1))
    radius = half * np.float32(math.sqrt(spacing[0] ** 2 + spacing[1] ** 2 + spacing[2] ** 2))
    x, y, z = cube_of(cube, shape)
    right, down, ahead = in_camera(
        lower[0] + (np.float32(x) + half) * spacing[0], lower[1] + (np.float32(y) + half) * spacing[1],
        lower[2] + (np.float32(z) + half) * spacing[2], rotation, position,
    )  # fmt: skip
    return x, y, z, may_show(right, down, ahead, radius, lens, width, height)


@kernel()
def position_of(i, j, k, lower, spacing):
    """Position of a node in the world [m]."""
    x, y = lower[0] + np.float32(i) * spacing[0], lower[1] + np.float32(j) * spacing[1]
    return x, y, lower[2] + np.float32(k) * spacing[2]


@kernel()
def picture_of(right, down, ahead, lens):
    """Project a point in the camera's frame to pixels; the point must be ahead of the camera."""
    return lens[0] * right / ahead + lens[2], lens[1] * down / ahead + lens[3]


@kernel()
def window_of(u, v, reach, sizes, width, height):
    """The smallest window around a place in the picture: index of its size, its first column and row.

    It holds all pixels within `reach` to each side. The index is -1 where it would leave the picture.
    """
    left, top = math.floor(u - reach), math.floor(v - reach)
    needed = max(math.floor(u + reach) - left, math.floor(v + reach) - top) + 1
    for level in range(sizes.shape[0]):
        size = sizes[level]
        if size >= needed:
            left, top = left - (size - needed) // 2, top - (size - needed) // 2
            if left < 0 or top < 0 or left + size > width or top + size > height:
                return -1, 0, 0
            return level, left, top
    return -1, 0, 0
