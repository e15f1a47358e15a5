"""Depth fusion: prove nodes of a grid free or solid by depth maps (Curless and Levoy, "A volumetric method for
building complex models from range images", SIGGRAPH 1996).

A node is proven free where at least one picture looked past it: all depths within a voxel to each side of it end more
than a voxel behind it, so that a voxel of nothing is around it; and where hardly any picture met a surface within a
voxel of it. The others get the weighted mean s of their signed distances from surfaces, and from that their density:

    raw(s) = raw(rho_0) + SLOPE (BEFORE - s / voxel)

between empty and the densest there is: rho_0, which planners take for solid, a little in front of the surface, and
opaque a voxel behind it.

A pixel's depth d puts a point P on a surface, and its neighbours the surface's normal n there, turned to the camera.
The signed distance of a node X is (X - P) . n, above 0 in front of the surface: exact for planes, at any angle.
"""

import math
from dataclasses import dataclass

import cv2
import numpy as np
import torch
from jaxtyping import Bool, Float, UInt8
from torch import Tensor

from nerfnav.core.jit import default_threads, kernel, prange, threads
from nerfnav.field.core.occupancy import EMPTY_RAW, SOLID_DENSITY, raw_of
from nerfnav.field.kernels.views import SIDE, cube_count, cube_in_view, in_camera, picture_of, position_of, window_of
from nerfnav.geometry import Box, Camera, Pose, PosedImages, spacing_of

SIZES = np.array([1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 24, 32, 48, 64], np.int64)
"""Sizes of the windows of pixels that a node may stand for."""
_SLOPE = 8.0
"""Rise of raw density in a voxel towards the inside: density grows a hundredfold in half a voxel."""
_BEFORE = 0.25
"""Distance in front of surfaces at which density begins [voxels]."""
_DENSEST = 2.0
"""The largest raw density."""
_LEAST_FREE = 1
"""Pictures that must have looked past a free node."""
_MOST_HITS = 0.2
"""Pictures that may have met a surface at a free node, for each that looked past it, where depths are measured. A
renderer's are exact: there one is enough."""


@dataclass(frozen=True)
class FusedDepth:
    """Occupancy, density and colour of each node, fused from depth maps."""

    free: Bool[Tensor, "nx ny nz"]
    """Nodes that are proven free."""
    known: Bool[Tensor, "nx ny nz"]
    """Nodes of which depth gives the density: they are free, or near a surface."""
    raw: Float[Tensor, "nx ny nz"]
    """Its raw density; meaningless where it is not known."""
    color: Float[Tensor, "nx ny nz 3"]
    """Mean colour of the surface near it, in [0, 1]; grey where there is none."""


def fuse_depth(photographs: PosedImages, box: Box, shape: tuple[int, int, int]) -> FusedDepth:
    """Fuse the depth maps of `photographs` on the nodes of a grid. Raises ValueError without depth."""
    camera = photographs.depth_camera
    spacing = spacing_of(box, shape)
    voxel = float(spacing.max())
    grid = (box.lower.numpy().astype(np.float32), spacing.numpy().astype(np.float32), np.float32(voxel))
    free, hits = np.zeros((2, *shape), np.uint8)
    weight, distance = np.zeros((2, *shape), np.float32)
    color = np.zeros((*shape, 3), np.float32)
    assert photographs.depth is not None
    with threads(default_threads()):
        for index, (rotation, position, lens) in enumerate(kernel_views(photographs.poses, camera)):
            depth = _known_depth(photographs.depth[index])
            points, normals = surface_of(depth, lens, rotation, position)
            image = cv2.resize(photographs.images[index].numpy(), (camera.width, camera.height))
            maps = (depth, points, normals, nearest_within(depth), image.astype(np.float32) / 255)
            fuse(
                grid, (rotation, position, lens), maps, SIZES, np.float32(photographs.depth_noise),
                (free, hits, weight, distance, color),
            )  # fmt: skip
    most_hits = _MOST_HITS * free if photographs.depth_noise > 0 else 0
    proven = torch.from_numpy((free >= _LEAST_FREE) & (hits <= most_hits))
    seen = weight > 0
    mean = np.divide(distance, weight, out=np.full(shape, np.inf, np.float32), where=seen)
    tint = np.divide(color, weight[..., None], out=np.full_like(color, 0.5), where=seen[..., None])
    raw = np.clip(raw_of(SOLID_DENSITY) + _SLOPE * (_BEFORE - mean / voxel), EMPTY_RAW, _DENSEST)
    dense = torch.where(proven, torch.tensor(EMPTY_RAW), torch.from_numpy(raw))
    return FusedDepth(proven, proven | torch.from_numpy(seen), dense, torch.from_numpy(tint))


def kernel_views(
    poses: Pose, camera: Camera
) -> list[tuple[Float[np.ndarray, "3 3"], Float[np.ndarray, "3"], Float[np.ndarray, "4"]]]:
    """Rotation, position and lens (fx, fy, cx, cy) of a camera at each of many poses, as kernels take them."""
    lens = np.array([camera.fx, camera.fy, camera.cx, camera.cy], np.float32)
    parts = (np.ascontiguousarray(part.numpy(), np.float32) for part in (poses.rotation, poses.position))
    return [(rotation, position, lens) for rotation, position in zip(*parts, strict=True)]


def nearest_within(depth: Float[np.ndarray, "h w"]) -> Float[np.ndarray, "levels h w"]:
    """The smallest depth in the windows of all `SIZES` that begin at each pixel."""
    levels, done = np.empty((len(SIZES), *depth.shape), np.float32), 1
    for level, size in enumerate(SIZES.tolist()):  # each from the one before it
        depth, done = cv2.erode(depth, window(size - done + 1), anchor=(0, 0)), size
        levels[level] = depth
    return levels


def window(size: int) -> UInt8[np.ndarray, "size size"]:
    """A square for cv2's minima and maxima."""
    return np.ones((size, size), np.uint8)


def _known_depth(depth: Float[Tensor, "h w"]) -> Float[np.ndarray, "h w"]:
    """Depths with 0 for all that are none."""
    known = depth.numpy().astype(np.float32)
    return np.ascontiguousarray(np.where(known > 0, known, np.float32(0.0)))  # nor is NaN above 0


MOST = 255
"""Counting ends here."""
BAND = np.float32(2.0)
"""Signed distances are taken so far from a surface [voxels]."""
_BESIDE = np.float32(1.5)
"""Radius around a surface's point within which the surface is taken for flat [voxels]."""
_GRAZING = np.float32(0.12)
"""Cosine between ray and normal below which a pixel gives no distance."""
_BEHIND = np.float32(0.25)
"""Weight of a node behind a surface: it may be in front of another one, which others see."""


@kernel()
def ray_of(column, row, lens, rotation, way):
    """Write the unit direction of a pixel's ray in the world into `way`."""
    x = (np.float32(column) + np.float32(0.5) - lens[2]) / lens[0]
    y = -(np.float32(row) + np.float32(0.5) - lens[3]) / lens[1]
    scale = np.float32(1.0) / np.float32(math.sqrt(x * x + y * y + np.float32(1.0)))
    for axis in range(3):
        way[axis] = scale * (rotation[axis, 0] * x + rotation[axis, 1] * y - rotation[axis, 2])


@kernel()
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
