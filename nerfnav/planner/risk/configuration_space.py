"""Configuration-space obstacles: positions at which a level body does not fit, as accurately as a field allows.

Maps to search on (space/occupancy.py) err to the safe side by up to a voxel, which is 4 cm for the paper's robot;
that is as much as noise moves it, and a chance that is computed on them may be ten times too large, more so beside
one thing than beside another. Here nothing is added on purpose: points stand so densely that half of the body is a
whole number of their distances, and a place is an obstacle where a point that the body would cover is dense.
"""

import math
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float, UInt8
from torch import Tensor

from nerfnav.core.memory import require_memory
from nerfnav.field import Field, GridField
from nerfnav.geometry import Box
from nerfnav.planner.space.occupancy import (
    OccupancyConfig,
    OccupancyMap,
    build_levels,
    covered,
    dense_at,
    headings_of,
    pooled,
)
from nerfnav.planner.space.scales import Scales, grain_of
from nerfnav.robots import Body

_ACROSS, _FEWEST = 8, 4
"""Points to the width of a body, and their number where that is too many, or fields are slow."""
_MOST = 6_000_000
"""Points in all, as long as half of the body is no whole number of their distances: to make it one, up to four times as
many are taken."""
_BYTES = 48
"""Largest memory of a point until chances are made of it (collision_map.py): 36 to 43 were measured. And one for
each heading."""
_SLAB = 8
"""Layers of points that are evaluated at once."""


@dataclass(frozen=True, eq=False)
class CSpace:
    """Obstacles at the nodes of a grid."""

    by_heading: Bool[np.ndarray, "h nx ny nz"]
    """True where the body's centre cannot be, with headings evenly over half a turn, begun at 0; a single one of a
    body that is about as long as wide."""
    lower: Float[np.ndarray, "3"]
    """The first node [m]."""
    spacing: Float[np.ndarray, "3"]
    """Distance of nodes [m]."""
    sampled: bool = True
    """False for those of an occupancy map, in a field that is slow or too coarse to be sampled."""

    @classmethod
    def of(cls, field: Field, body: Body, height: float | None = None) -> "CSpace":
        """Compute the obstacles of a body in a field; with a `height` [m] of a body that never leaves it, in a single
        layer.

        Raises InvalidInputError where the memory cannot hold it, before it is made.
        """
        scales, grain = OccupancyConfig().scales(field, body), grain_of(field) or 0.0
        affordable = (field.box.size.double().prod().item() / _MOST) ** (1 / 3)
        if isinstance(field, GridField):
            wanted = max(min(scales.width / _ACROSS, grain), affordable)
            if wanted <= min(grain, scales.width / _FEWEST):
                return cls._sampled(field, body, scales, wanted, height)
        # points further apart than the field's resolution would miss things, and networks are slow
        voxel = max(scales.width / _FEWEST, grain, affordable)
        coarse = OccupancyMap.of(field, body, OccupancyConfig(voxel=voxel, samples_per_voxel=1), height)
        lower, spacing = coarse.box.lower.double().cpu().numpy(), coarse.spacing.double().numpy()
        return cls(coarse.dense.numpy(), lower, spacing, sampled=False)

    def clearance(self, path: Float[np.ndarray, "n 3"], most: float) -> float:
        """Measure the least distance of places from an obstacle with any heading, and from the border [m], at most
        `most` [m]; 0 for places that are not finite."""
        if not np.isfinite(path).all():
            return 0.0
        shape = np.array(self.by_heading.shape[1:])
        upper = self.lower + (shape - 1) * self.spacing
        nearest = min(most, float(np.minimum(path - self.lower, upper - path).min()))
        if nearest <= 0:
            return 0.0
        first = np.floor((path.min(0) - nearest - self.lower) / self.spacing).astype(int).clip(0)
        last = np.ceil((path.max(0) + nearest - self.lower) / self.spacing).astype(int)
        blocked = self.by_heading[(slice(None), *map(slice, first, last + 1))].any(0)
        nodes = (np.argwhere(blocked) + first) * self.spacing + self.lower
        return min((nearest, *(float(np.linalg.norm(nodes - place, axis=1).min()) for place in path if len(nodes))))

    def blocks(self, places: Float[np.ndarray, "*batch 3"]) -> Bool[np.ndarray, "*batch"]:
        """Check whether the body does not fit at places [m] with some heading, by the nearest nodes; beyond the border
        it does not."""
        nodes, shape = np.rint((places - self.lower) / self.spacing), self.by_heading.shape[1:]
        inside = np.logical_and(nodes >= 0, nodes < shape).all(-1)
        x, y, z = np.moveaxis(np.where(np.expand_dims(inside, -1), nodes, 0).astype(int), -1, 0)
        return np.logical_or(self.by_heading[:, x, y, z].any(0), ~inside)

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
        if height is not None:
            lower[2], axes[2] = height, build_levels(body, height).double()
        headings = headings_of(OccupancyConfig(), scales)
        count = math.prod(len(axis) for axis in axes)
        require_map_memory(count * (_BYTES + len(headings)), f"at {count:,} points {side:.3g} m apart")
        if height is None:
            return cls(_marked(field, body, axes, spacing), lower, spacing)
        columns = _dense(field, axes, scales).amax(-1, keepdim=True)
        marked = covered(columns.numpy(), 1, _outlines(body, headings, spacing), spacing[:2])
        return cls(marked, lower, spacing)

    def updated(self, field: Field, body: Body, box: Box) -> "CSpace":
        """Compute the obstacles of a body in a field that differs from this one's in a box alone."""
        shape = self.by_heading.shape[1:]
        if not self.sampled:
            return CSpace.of(field, body)
        changed = box.grown(body.radius + float(self.spacing.max())).window(self.lower, self.spacing, shape)
        around = box.grown(2 * body.radius + 2 * float(self.spacing.max())).window(self.lower, self.spacing, shape)
        axes = [
            torch.from_numpy(low + step * np.arange(count))[part]
            for low, step, count, part in zip(self.lower, self.spacing, shape, around, strict=True)
        ]
        inner = tuple(
            slice(part.start - first.start, part.stop - first.start)
            for part, first in zip(changed, around, strict=True)
        )
        known = self.by_heading.copy()
        known[(slice(None), *changed)] = _marked(field, body, axes, self.spacing)[(slice(None), *inner)]
        return CSpace(known, self.lower, self.spacing)


def _dividing(length: float, most: float) -> float:
    """Compute the largest step up to `most` of which a length [m] is a whole number; `most` where it is next to
    none."""
    return length / math.ceil(length / most - 1e-6) if length > 0.5 * most else most


def _dense(field: Field, axes: list[Tensor], scales: Scales) -> UInt8[Tensor, "nx ny nz"]:
    """Mark the dense points of a grid, given along each axis [m]; a slab at a time, to save memory."""
    slabs = [torch.meshgrid(x, *axes[1:], indexing="ij") for x in axes[0].split(_SLAB)]
    return torch.cat([dense_at(field, torch.stack(slab, -1), scales.threshold) for slab in slabs])


def _marked(
    field: Field, body: Body, axes: list[Tensor], spacing: Float[np.ndarray, "3"]
) -> Bool[np.ndarray, "h nx ny nz"]:
    """Mark the points of a grid at which the body covers something dense, with each heading."""
    scales = OccupancyConfig().scales(field, body)
    columns = pooled(_dense(field, axes, scales), round(0.5 * body.extents[2] / float(spacing[2])))
    outlines = _outlines(body, headings_of(OccupancyConfig(), scales), spacing)
    return covered(columns.numpy(), 1, outlines, spacing[:2])


def _outlines(body: Body, headings: list[float], spacing: Float[np.ndarray, "3"]) -> Float[np.ndarray, "m 3"]:
    """Return half length and half width of the body [m], to the nearest column, for each heading [rad]."""
    half = 0.5 * np.array(body.extents[:2])
    if len(headings) == 1:  # any heading
        half[:] = half.max()
    # a column stands for what is half a column around it, so that a thin body turned to any heading covers some
    columns = np.maximum(np.round(half / spacing[:2]), 0.5)
    return np.array([[*(spacing[:2] * columns), heading] for heading in headings])


def require_map_memory(needed: float, what: str) -> None:
    """Refuse chances, or obstacles to make them of, that the memory cannot hold: `needed` bytes, for `what` of them."""
    require_memory(
        needed, f"the chance that noise pushes a robot into something, {what},", "plan without risk (--risk-weight 0)"
    )
