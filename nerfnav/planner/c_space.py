"""Where a level body does not fit, as well as a field can tell: the obstacles of its configuration space.

Maps to search on (occupancy.py) err to the safe side by up to a voxel, which is 4 cm for the paper's robot; that is as
much as noise moves it, and a chance that is reckoned on them may be ten times too large, more so beside one thing than
beside another. Here nothing is added on purpose: points stand so densely that half of the body is a whole number of
their distances, and a place is an obstacle where a point that the body would cover is dense.
"""

import math
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float, UInt8
from torch import Tensor

from nerfnav.compiled import default_threads, threads
from nerfnav.field import Field, GridField
from nerfnav.planner.columns import dense_at, pooled
from nerfnav.planner.kernels import maps
from nerfnav.planner.occupancy import OccupancyConfig, OccupancyMap, headings_of
from nerfnav.planner.scales import Scales, grain_of
from nerfnav.robots import Body

_ACROSS, _FEWEST = 8, 4
"""Points to the width of a body, and where so many are too many, or fields take long to ask."""
_MOST = 6_000_000
"""Points in all."""
_SLAB = 8
"""Layers of points that are asked for at once."""


@dataclass(frozen=True, eq=False)
class CSpace:
    """Obstacles at the nodes of a grid."""

    blocked: Bool[np.ndarray, "nx ny nz"]
    """Whether the body's centre cannot be there; of one that is longer than wide, with no heading."""
    lower: Float[np.ndarray, "3"]
    """The first node [m]."""
    spacing: Float[np.ndarray, "3"]
    """Distance of nodes [m]."""

    @classmethod
    def of(cls, field: Field, body: Body, height: float | None = None) -> "CSpace":
        """Of a body in a field; with a `height` [m] of a body that never leaves it, in a single layer."""
        scales = OccupancyConfig().scales(field, body)
        volume, grain = field.box.size.double().prod().item(), grain_of(field) or math.inf
        affordable = (volume / _MOST) ** (1 / 3)
        wanted = max(min(scales.width / _ACROSS, grain), affordable)
        if isinstance(field, GridField) and wanted <= min(grain, scales.width / _FEWEST):
            return cls._sampled(field, body, scales, wanted, height)
        # points further apart than what the field tells apart would miss things, and networks take long to answer
        voxel = max(scales.width / _FEWEST, grain if grain < math.inf else 0.0, affordable)
        coarse = OccupancyMap.of(field, body, OccupancyConfig(voxel=voxel, samples_per_voxel=1), height)
        lower, spacing = coarse.box.lower.double().cpu().numpy(), coarse.spacing.double().numpy()
        return cls(coarse.dense.all(0).numpy(), lower, spacing)

    @classmethod
    def _sampled(cls, field: Field, body: Body, scales: Scales, wanted: float, height: float | None) -> "CSpace":
        box = field.box.to("cpu")
        lower, size = box.lower.double().numpy(), box.size.double().numpy()
        side, tall = _dividing(0.5 * scales.width, wanted), _dividing(0.5 * body.extents[2], wanted)
        spacing = np.array([side, side, tall])
        axes = [
            first + step * torch.arange(math.ceil(edge / step - 1e-6) + 1, dtype=torch.float64)
            for first, edge, step in zip(lower.tolist(), size.tolist(), spacing.tolist(), strict=True)
        ]
        if height is None:
            columns = pooled(_dense(field, axes, scales), round(0.5 * body.extents[2] / tall))
        else:
            lower[2], axes[2] = height, height + body.points_body[:, 2].double().unique()
            columns = _dense(field, axes, scales).amax(-1, keepdim=True)
        return cls(_covering(columns.numpy(), body, scales, spacing), lower, spacing)


def _dividing(length: float, most: float) -> float:
    """The largest step up to `most` of which a length [m] is a whole number; `most` where it is next to none."""
    return length / math.ceil(length / most - 1e-6) if length > 0.5 * most else most


def _dense(field: Field, axes: list[Tensor], scales: Scales) -> UInt8[Tensor, "nx ny nz"]:
    """Whether it is dense at the points of a grid, given along each axis [m]; a slab at a time, to save memory."""
    slabs = [torch.meshgrid(x, *axes[1:], indexing="ij") for x in axes[0].split(_SLAB)]
    return torch.cat([dense_at(field, torch.stack(slab, -1), scales.threshold) for slab in slabs])


def _covering(
    columns: UInt8[np.ndarray, "nx ny nz"], body: Body, scales: Scales, spacing: Float[np.ndarray, "3"]
) -> Bool[np.ndarray, "nx ny nz"]:
    """Where a body covers a dense column, whatever its heading."""
    headings, half = headings_of(OccupancyConfig(), scales), 0.5 * np.array(body.extents[:2])
    if len(headings) == 1:
        half[:] = half.max()
    half = spacing[:2] * np.round(half / spacing[:2])
    marked = np.zeros((len(headings), *columns.shape), np.uint8)
    outlines = np.array([[*half, heading] for heading in headings])
    with threads(default_threads()):
        maps.mark_bodies(np.ascontiguousarray(columns), 1, outlines, spacing[:2], marked)
    return np.asarray(marked.all(0))
