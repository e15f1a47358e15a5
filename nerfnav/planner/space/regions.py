"""Connected components of free space on an occupancy map, and the ground that wheels can stand on.

A body gets from one voxel to another only within one component. What is left of it after erosion keeps that far off
solid space, so that a plan through it has room.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import scipy
from jaxtyping import Bool, Float

from nerfnav.field import Field
from nerfnav.geometry import node_positions
from nerfnav.planner.kernels import maps
from nerfnav.planner.space.occupancy import OccupancyMap, dense_at
from nerfnav.planner.space.scales import grain_of, threshold_of
from nerfnav.robots import Body

_ROOMS = (2.5, 1.0, 0.0)
"""Erosions that are tried [voxels]: first the clearance that paths prefer."""
_COLUMNS, _LEVELS = 120, 240
"""Most samples along each horizontal edge and along the height in the search for ground."""
_FLOORS = 3
"""Number of heights with the most ground that are tried."""
GAPS = (1.0, 2.0, 3.5)
"""Distances of the body's underside from the ground that are tried [nodes of the field]: the haze on it is solid."""


@dataclass(frozen=True)
class Region:
    """Component of free space, in which a body gets from everywhere to everywhere."""

    occupancy: OccupancyMap
    """Occupancy map of the region."""
    inside: Bool[np.ndarray, "nx ny nz"]
    """True for the voxels of the region."""

    @property
    def extent(self) -> float:
        """Measure the diagonal of the box around it [m]."""
        spans = [np.flatnonzero(self.inside.any(axes)) for axes in ((1, 2), (0, 2), (0, 1))]
        edges = [(span[-1] - span[0]) if len(span) else 0 for span in spans]
        return float(np.linalg.norm(np.array(edges) * self.occupancy.spacing.numpy()))


def free_regions(
    occupancy: OccupancyMap, supported: Bool[np.ndarray, "nx ny nz"] | None = None
) -> Iterator[Region]:
    """Yield the largest component of free space, the roomiest first: eroded by 2.5 voxels, by one, and as it is.

    Where that is all there is, at last that in which a slender body fits with some heading instead of with any.
    `supported` are the voxels that count at all; without it, all do.
    """
    every, some = occupancy.by_heading.any(0).numpy(), occupancy.by_heading.all(0).numpy()
    spacing = occupancy.spacing.numpy().astype(float)
    for blocked in (every, some) if len(occupancy.by_heading) > 1 else (every,):
        free = ~blocked if supported is None else ~blocked & supported
        for room in _ROOMS:
            inside = _largest(_eroded(free, room * float(spacing.max()), spacing))
            if inside.any():
                yield Region(occupancy, inside)


def ground_regions(
    matter: Field, body: Body, box_map: Callable[[float], OccupancyMap]
) -> Iterator[Region]:
    """Yield free regions of a body that stands on the ground, one for each height at which there is ground, best first.

    `matter` is the field as it was learned: unproven space does not support a robot. `box_map` gives the map of a
    height [m].
    """
    found: list[tuple[float, Region]] = []
    levels = _Levels.of(matter, body)
    for index, (height, gap) in levels.heights():
        occupancy = box_map(height)
        supported = levels.supported(height, gap, occupancy.by_heading.shape[1:3])
        best = max(free_regions(occupancy, supported), key=lambda region: region.extent, default=None)
        if best is not None:
            # the nearer to the ground the better, unless there is much less room
            found.append((best.extent * (1 - 0.1 * index), best))
    yield from (region for _, region in sorted(found, key=lambda pair: -pair[0]))


@dataclass(frozen=True)
class _Levels:
    """Levels with ground under free space."""

    tops: Bool[np.ndarray, "fx fy nz"]
    """True where something solid ends at a level, with room for the body above."""
    z: Float[np.ndarray, " nz"]
    """Heights of the levels [m]."""
    grain: float
    """Distance of the field's nodes [m]."""
    half: float
    """Half height of the body [m]."""

    @classmethod
    def of(cls, field: Field, body: Body) -> "_Levels":
        box = field.box.to("cpu")
        grain = grain_of(field) or float(box.size.max()) / _LEVELS
        nx, ny, nz = (max(2, math.ceil(float(edge) / grain) + 1) for edge in box.size)
        shape = min(nx, _COLUMNS), min(ny, _COLUMNS), min(nz, _LEVELS)
        solid = dense_at(field, node_positions(box, shape), threshold_of(field)).numpy().astype(bool)
        z = np.linspace(float(box.lower[2]), float(box.upper[2]), shape[2])
        blocked = np.zeros_like(solid)
        for level in range(1, math.ceil(body.extents[2] / (z[1] - z[0])) + 1):
            blocked[..., :-level] |= solid[..., level:]
            blocked[..., -level:] = True
        return cls(solid & ~blocked, z, max(grain, float(z[1] - z[0])), 0.5 * body.extents[2])

    def heights(self) -> Iterator[tuple[int, tuple[float, float]]]:
        """List heights of the body's middle and gaps below it [m], with the number of the gap."""
        counts = np.convolve(self.tops.sum((0, 1)).astype(float), [0.5, 1.0, 0.5], mode="same")
        for _ in range(_FLOORS):
            best = int(counts.argmax())
            if counts[best] <= 0:
                return
            for index, gap in enumerate(GAPS):
                height = float(self.z[best]) + (gap + 0.5) * self.grain + self.half
                if height + self.half < self.z[-1]:
                    yield index, (round(height, 3), gap * self.grain)
            counts[max(0, best - 3) : best + 4] = 0

    def supported(self, height: float, gap: float, shape: tuple[int, ...]) -> Bool[np.ndarray, "nx ny 1"]:
        """Mark the places with ground right below a body at that height."""
        bottom = height - self.half
        near = (self.z <= bottom) & (self.z >= bottom - gap - 3 * self.grain - self.half)
        coarse: np.ndarray = np.any(self.tops[..., near], axis=-1)
        rows, columns = (
            np.round(np.linspace(0, have - 1, want)).astype(int) for have, want in zip(coarse.shape, shape, strict=True)
        )
        closed: np.ndarray = np.asarray(scipy.ndimage.binary_closing(coarse[np.ix_(rows, columns)], iterations=2))
        return closed.reshape(*closed.shape, 1)


def _eroded(
    free: Bool[np.ndarray, "nx ny nz"], reach: float, spacing: Float[np.ndarray, "3"]
) -> Bool[np.ndarray, "nx ny nz"]:
    """Select the voxels farther than `reach` [m] from space that is not free, the border of the box included."""
    around = tuple((1, 1) if count > 1 else (0, 0) for count in free.shape)
    blocked = np.pad(~free, around, constant_values=True)
    # prices rise within the reach; a little more, for they hardly rise at its end
    prices = maps.prices_near(blocked.view(np.uint8), spacing, 1.0001 * reach, 1.0)
    x, y, z = (slice(before, size - after) for (before, after), size in zip(around, blocked.shape, strict=True))
    return prices[x, y, z] == 1


def _largest(mask: Bool[np.ndarray, "nx ny nz"]) -> Bool[np.ndarray, "nx ny nz"]:
    """Select the largest connected component over faces."""
    labels = np.zeros(mask.shape, np.int32)  # numbers from 1, 0 where there is none
    if int(scipy.ndimage.label(mask, output=labels)) <= 1:  # type: ignore[arg-type]
        return mask
    sizes = np.bincount(labels.ravel())
    sizes[0] = 0
    return labels == sizes.argmax()
