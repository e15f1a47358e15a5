"""Depth fusion: prove nodes of a grid free or solid by depth maps (Curless and Levoy, "A volumetric method for
building complex models from range images", SIGGRAPH 1996).

A node is proven free where at least one picture looked past it: all depths within a voxel to each side of it end more
than a voxel behind it, so that a voxel of nothing is around it; and where hardly any picture met a surface within a
voxel of it. The others get the weighted mean s of their signed distances from surfaces, and from that their density:

    raw(s) = raw(rho_0) + SLOPE (BEFORE - s / voxel)

between empty and the densest there is: rho_0, which planners take for solid, a little in front of the surface, and
opaque a voxel behind it.
"""

from dataclasses import dataclass

import cv2
import numpy as np
import torch
from jaxtyping import Bool, Float, UInt8
from torch import Tensor

from nerfnav.core.jit import default_threads, threads
from nerfnav.field.core.occupancy import EMPTY_RAW, SOLID_DENSITY, raw_of
from nerfnav.field.kernels import fusion
from nerfnav.geometry import Box, PosedImages, spacing_of

SIZES = np.array([1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 24, 32, 48, 64], np.int64)
"""Sizes of the windows of pixels that a node may stand for."""
_SLOPE = 8.0
"""How much raw density rises in a voxel towards the inside: to a hundred times as much in half a voxel."""
_BEFORE = 0.25
"""How far in front of surfaces density begins [voxels]."""
_DENSEST = 2.0
"""The largest raw density."""


@dataclass(frozen=True)
class FusionConfig:
    """When a node counts as free."""

    least_free: int = 1
    """Pictures that must have looked past it."""
    most_hits: float = 0.2
    """Pictures that may have met a surface at it, for each that looked past it, where depths are measured. A
    renderer's are exact: there one is enough."""


@dataclass(frozen=True)
class FusedDepth:
    """What depths say of each node."""

    free: Bool[Tensor, "nx ny nz"]
    """Whether it is proven free."""
    known: Bool[Tensor, "nx ny nz"]
    """Whether depths tell its density: it is free, or near a surface."""
    raw: Float[Tensor, "nx ny nz"]
    """Its raw density; meaningless where it is not known."""
    color: Float[Tensor, "nx ny nz 3"]
    """Mean colour of the surface near it, in [0, 1]; grey where there is none."""


def fuse_depth(
    photographs: PosedImages, box: Box, shape: tuple[int, int, int], config: FusionConfig | None = None
) -> FusedDepth:
    """What the depths of `photographs` say of the nodes of a grid. Raises ValueError where they have none."""
    config = config or FusionConfig()
    camera = photographs.depth_camera
    spacing = spacing_of(box, shape)
    voxel = float(spacing.max())
    grid = (box.lower.numpy().astype(np.float32), spacing.numpy().astype(np.float32), np.float32(voxel))
    lens = np.array([camera.fx, camera.fy, camera.cx, camera.cy], np.float32)
    free, hits = np.zeros((2, *shape), np.uint8)
    weight, distance = np.zeros((2, *shape), np.float32)
    color = np.zeros((*shape, 3), np.float32)
    assert photographs.depth is not None
    with threads(default_threads()):
        for index in range(len(photographs)):
            rotation = np.ascontiguousarray(photographs.poses.rotation[index].numpy(), np.float32)
            position = np.ascontiguousarray(photographs.poses.position[index].numpy(), np.float32)
            depth = _known_depth(photographs.depth[index])
            points, normals = fusion.surface_of(depth, lens, rotation, position)
            image = cv2.resize(photographs.images[index].numpy(), (camera.width, camera.height))
            maps = (depth, points, normals, nearest_within(depth), image.astype(np.float32) / 255)
            fusion.fuse(
                grid, (rotation, position, lens), maps, SIZES, np.float32(photographs.depth_noise),
                (free, hits, weight, distance, color),
            )  # fmt: skip
    most_hits = config.most_hits * free if photographs.depth_noise > 0 else 0
    proven = torch.from_numpy((free >= config.least_free) & (hits <= most_hits))
    seen = weight > 0
    mean = np.divide(distance, weight, out=np.full(shape, np.inf, np.float32), where=seen)
    tint = np.divide(color, weight[..., None], out=np.full_like(color, 0.5), where=seen[..., None])
    raw = np.clip(raw_of(SOLID_DENSITY) + _SLOPE * (_BEFORE - mean / voxel), EMPTY_RAW, _DENSEST)
    dense = torch.where(proven, torch.tensor(EMPTY_RAW), torch.from_numpy(raw))
    return FusedDepth(proven, proven | torch.from_numpy(seen), dense, torch.from_numpy(tint))


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
