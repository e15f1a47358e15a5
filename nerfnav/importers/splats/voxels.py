"""Voxelization: make a voxel field of splats whose densities stop as much light as the splats do.

Notation: splat k has opacity o, standard deviations s_1 >= s_2 >= s_3 along its axes, covariance S. A ray through its
centre along the thinnest axis is to lose -log(1 - o) = t of optical depth, so its density is

    rho(p) = a exp(-q/2),  a sqrt(2 pi) s_3 = t,  q = (p - m)' S^-1 (p - m)

Along its longer axes it stops more than a splat would; splats are flat and lie on surfaces, where that is what a
solid thing does. A grid can hold nothing narrower than half a voxel, and a node is to stand for the mean of the
density, weighted by its hat function, whose variance along an axis is 1/6 of a squared voxel. So each splat is
blurred by both, S' = S + w^2 I with w^2 = 1/4 + 1/6 squared voxels, keeping its integral M = t 2 pi s_1 s_2

    a' = M / ((2 pi)^(3/2) sqrt(det S'))

and the nodes' raw densities are fitted to these means (see nerfnav/field/edit/bake.py).
"""

from dataclasses import dataclass

import numpy as np
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.core.jit import default_threads, threads
from nerfnav.field import FieldInfo, VoxelField
from nerfnav.field.edit.bake import fitted, fitting_shape
from nerfnav.geometry import Box, spacing_of
from nerfnav.importers.splats.gaussians import Splats, robust_extent
from nerfnav.importers.splats.kernels.splatting import REACH, splat

MOST_NODES = 60_000_000
"""A field's nodes have four numbers each."""
_NODES_ALONG = 200
"""Nodes along the longest edge of the box, where nothing else is asked for."""
_NODES = 4_000_000
"""The most nodes then."""
_LARGEST_OPACITY = 0.99  # as renderers of splats have it: nothing is quite opaque
_OPAQUE = 8.0  # optical depth of a voxel beyond which nothing is seen to change
_BLUR = 1 / 6 + 1 / 4  # variance of a hat function, and of the narrowest thing that a grid can hold, in squared voxels
_MARGIN = 3.0  # nodes between the outermost centres and the box's border


@dataclass(frozen=True)
class VoxelizeConfig:
    """Options of the conversion of splats to a voxel field."""

    voxel: float | None = None
    """Distance of nodes [m]; None: a 200th of the longest edge, more where that is more than a few million nodes."""
    box: Box | None = None
    """Box of the field; None: around nearly all of the splats' opacity."""
    sweeps: int = 6
    """Number of corrections of the raw densities."""
    empty_below: float = 0.005
    """Optical depth that a node must have across itself to count; places without a known unit have no density that
    would be little in all of them."""


def voxelize(splats: Splats, config: VoxelizeConfig | None = None, source: str = "") -> VoxelField:
    """A voxel field of splats that are in metres with Z up.

    Raises InvalidInputError where the grid makes no sense, or memory cannot hold it.
    """
    config = VoxelizeConfig() if config is None else config
    box = _box_of(splats, config) if config.box is None else config.box
    if not bool((box.size > 0).all()):
        raise InvalidInputError(
            f"{source or 'the field'}: the box {box.describe()} is empty: its upper corner must lie beyond the lower"
        )
    voxel = _voxel_for(box) if config.voxel is None else config.voxel
    shape = fitting_shape(box, voxel, MOST_NODES, source or "the field")
    density, color = np.zeros(shape, np.float32), np.zeros((*shape, 3), np.float32)
    arrays = _in_grid(splats, box, spacing_of(box, shape).numpy().astype(np.float64))
    with threads(default_threads()):
        splat(*arrays, density, color)
    mean = color / np.maximum(density, 1e-12)[..., None]
    raw = fitted(torch.from_numpy(density).clamp_max(_OPAQUE / voxel), config.sweeps, config.empty_below / voxel)
    values = torch.cat([raw[..., None], torch.from_numpy(mean)], -1)
    return VoxelField(box, values, torch.ones(3), FieldInfo(source=source, made_by="imported"))


def _voxel_for(box: Box) -> float:
    """A distance of nodes that shows what there is and is quick to fill and to plan in [m]."""
    return max(float(box.size.max()) / _NODES_ALONG, (box.size.double().prod().item() / _NODES) ** (1 / 3))


def _box_of(splats: Splats, config: VoxelizeConfig) -> Box:
    """Box around nearly all of the opacity, with a margin."""
    lower, upper = robust_extent(splats.centers, splats.masses)
    widest = float((upper - lower).max()) or 6 * float(np.sqrt(np.trace(splats.covariances.mean(0))))
    margin = _MARGIN * (widest / _NODES_ALONG if config.voxel is None else config.voxel)
    flat = 0.05 * widest  # a sheet still needs a box that is not flat
    grow = np.maximum(margin, 0.5 * (flat - (upper - lower)))
    return Box.of(lower - grow, upper + grow)


def _in_grid(splats: Splats, box: Box, spacing: np.ndarray) -> tuple[np.ndarray, ...]:
    """Arguments of the kernel: splats blurred by a node's width, in grid coordinates; `spacing` is that of nodes
    [m]."""
    covariances = splats.covariances.astype(np.float64)
    squares = np.linalg.eigvalsh(covariances).clip(1e-16, None)  # ascending
    depth = -np.log1p(-splats.opacities.astype(np.float64).clip(0, _LARGEST_OPACITY))
    mass = depth * 2 * np.pi * np.sqrt(squares[:, 1] * squares[:, 2])
    blurred = covariances + _BLUR * np.diag(spacing**2)
    amplitudes = mass / ((2 * np.pi) ** 1.5 * np.sqrt(np.linalg.det(blurred)))
    blurred /= spacing[:, None] * spacing
    precisions = np.linalg.inv(blurred)[:, *np.triu_indices(3)]
    reaches = REACH * np.sqrt(np.diagonal(blurred, axis1=1, axis2=2))
    centers = (splats.centers - box.lower.numpy()) / spacing
    parts = (centers, precisions, reaches, amplitudes, splats.rgbs)
    return tuple(np.ascontiguousarray(part, np.float32) for part in parts)
