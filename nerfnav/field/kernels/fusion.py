"""Depth fusion kernels: mark nodes that rays passed well before a surface, and measure signed distances of others.

A pixel's depth d puts a point P on a surface, and its neighbours the surface's normal n there, turned to the camera.
The signed distance of a node X is (X - P) . n, above 0 in front of the surface: exact for planes, at any angle.
"""

import math

import numpy as np

from nerfnav.core.jit import kernel, prange
from nerfnav.field.kernels.views import SIDE, cube_count, cube_in_view, in_camera, picture_of, position_of, window_of

MOST = 255
"""Counting ends here."""
BAND = np.float32(2.0)
"""Signed distances are taken so far from a surface [voxels]."""
_BESIDE = np.float32(1.5)
"""A surface's point tells of nodes so far beside it [voxels]; it is taken for flat there."""
_GRAZING = np.float32(0.12)
"""Cosine between ray and normal below which a pixel tells no distance."""
_BEHIND = np.float32(0.25)
"""What a node behind a surface weighs: it may be in front of another one, which others see."""


@kernel(inline=True)
def ray_of(column, row, lens, rotation, way):
    """Write the unit direction of a pixel's ray in the world into `way`."""
    x = (np.float32(column) + np.float32(0.5) - lens[2]) / lens[0]
    y = -(np.float32(row) + np.float32(0.5) - lens[3]) / lens[1]
    scale = np.float32(1.0) / np.float32(math.sqrt(x * x + y * y + np.float32(1.0)))
    for axis in range(3):
        way[axis] = scale * (rotation[axis, 0] * x + rotation[axis, 1] * y - rotation[axis, 2])


@kernel(inline=True)
def tangent(points, depth, row, column, down, right, along):
    """Write the difference to the nearer in depth of both neighbours into `along`; whether there is one."""
    height, width = depth.shape
    here, best, sign = depth[row, column], np.float32(np.inf), 0
    for side in range(-1, 2, 2):
        i, j = row + side * down, column + side * right
        if 0 <= i < height and 0 <= j < width and np.float32(0.0) < depth[i, j] < np.float32(np.inf):
            jump = abs(depth[i, j] - here)
            if jump < best:
                best, sign = jump, side
    for axis in range(3):
        other = points[row + sign * down, column + sign * right, axis]
        along[axis] = np.float32(sign) * (other - points[row, column, axis])
    return sign != 0


@kernel(parallel=True)
def surface_of(depth, lens, rotation, position):
    """Points (h, w, 3) on surfaces and their normals, zero where there are none, of a depth map (h, w)."""
    height, width = depth.shape
    points = np.zeros((height, width, 3), np.float32)
    normals = np.zeros((height, width, 3), np.float32)
    for row in prange(height):
        way = np.empty(3, np.float32)
        for column in range(width):
            if np.float32(0.0) < depth[row, column] < np.float32(np.inf):
                ray_of(column, row, lens, rotation, way)
                for axis in range(3):
                    points[row, column, axis] = position[axis] + depth[row, column] * way[axis]
    for row in prange(height):
        across, along = np.empty(3, np.float32), np.empty(3, np.float32)
        for column in range(width):
            if not np.float32(0.0) < depth[row, column] < np.float32(np.inf):
                continue
            if not tangent(points, depth, row, column, 0, 1, across):
                continue
            if not tangent(points, depth, row, column, 1, 0, along):
                continue
            x = across[1] * along[2] - across[2] * along[1]
            y = across[2] * along[0] - across[0] * along[2]
            z = across[0] * along[1] - across[1] * along[0]
            facing = np.float32(0.0)
            point = points[row, column]
            facing += x * (position[0] - point[0]) + y * (position[1] - point[1]) + z * (position[2] - point[2])
            size = np.float32(math.sqrt(x * x + y * y + z * z))
            if size > np.float32(0.0):
                scale = (np.float32(1.0) if facing > np.float32(0.0) else np.float32(-1.0)) / size
                normals[row, column, 0], normals[row, column, 1] = scale * x, scale * y
                normals[row, column, 2] = scale * z
    return points, normals


@kernel(parallel=True)
def fuse(grid, view, maps, sizes, noise, sums):
    """Add to `sums` what one picture says of each node.

    `grid` = (lower, spacing, voxel [m]), `view` = (rotation, position, lens), `maps` = (depth (h, w), points, normals
    (h, w, 3), nearest (levels, h, w), colors (h, w, 3) in 0 to 1), of which `nearest` holds the smallest depth within
    windows of `sizes` pixels that begin at each pixel, 0 where any of it is not known. `noise` is the share by which
    depths may be wrong.
    `sums` = (free, hits (nx, ny, nz): pictures that looked past the node, and that saw a surface within a voxel;
    weight, distance [m] (nx, ny, nz), color (nx, ny, nz, 3): of surfaces within `BAND` voxels).
    """
    lower, spacing, voxel = grid
    rotation, position, lens = view
    depth, points, normals, nearest, colors = maps
    free, hits, weight, distance, color = sums
    shape, (height, width) = free.shape, depth.shape
    for cube in prange(cube_count(shape)):
        x0, y0, z0, seen = cube_in_view(cube, lower, spacing, shape, view, width, height)
        if not seen:
            continue
        for i in range(x0, min(x0 + SIDE, shape[0])):
            for j in range(y0, min(y0 + SIDE, shape[1])):
                for k in range(z0, min(z0 + SIDE, shape[2])):
                    x, y, z = position_of(i, j, k, lower, spacing)
                    right, down, ahead = in_camera(x, y, z, rotation, position)
                    if ahead <= np.float32(1e-9):
                        continue
                    place = picture_of(right, down, ahead, lens)
                    if not (np.float32(0.0) <= place[0] < width and np.float32(0.0) <= place[1] < height):
                        continue
                    away = np.float32(math.sqrt(right * right + down * down + ahead * ahead))
                    level, left, top = window_of(place[0], place[1], voxel * lens[0] / ahead, sizes, width, height)
                    if level >= 0 and nearest[level, top, left] * (np.float32(1.0) - noise) > away + voxel:
                        free[i, j, k] = min(free[i, j, k] + 1, MOST)
                    u, v = int(place[0]), int(place[1])
                    met = depth[v, u]
                    if not abs(met - away) < np.float32(8.0) * voxel + met * noise:  # nor for infinity
                        continue
                    a, b, c = x - points[v, u, 0], y - points[v, u, 1], z - points[v, u, 2]
                    apart = a * a + b * b + c * c
                    signed = a * normals[v, u, 0] + b * normals[v, u, 1] + c * normals[v, u, 2]
                    beside = math.sqrt(max(apart - signed * signed, np.float32(0.0)))
                    if abs(signed) <= voxel and beside <= _BESIDE * voxel:
                        hits[i, j, k] = min(hits[i, j, k] + 1, MOST)
                    facing = np.float32(0.0)
                    for axis in range(3):
                        facing += normals[v, u, axis] * (position[axis] - points[v, u, axis]) / met
                    reach = _BESIDE * voxel + np.float32(0.75) * met / lens[0]
                    if facing < _GRAZING or abs(signed) > BAND * voxel or beside > reach:
                        continue
                    share = facing / (met * met) * (np.float32(1.0) if signed > -voxel else _BEHIND)
                    weight[i, j, k] += share
                    distance[i, j, k] += share * signed
                    for channel in range(3):
                        color[i, j, k, channel] += share * colors[v, u, channel]
