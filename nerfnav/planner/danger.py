"""The chance that noise makes a body touch something, by where its plan has its centre.

    c(p) = P(the body does not fit at p + d),  d ~ N(0, P)   =   (1_occupied * N(0, P))(p)

with P of spread.py: where the body does not fit (occupancy.py: the Minkowski sum of the body and what is solid),
blurred. It is the expectation of hitting the body as a whole; the same sum over body points as in Eq. 1 would count one
hit as often as there are points. P is the same everywhere, so that one map serves all plans in a place. The body is
taken level, and of one that is longer than wide its best heading. Plans keep all of the body inside of the field's box
(border.py); where noise may push it a little beyond, things are taken to be as they are at the border.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy
from jaxtyping import Float

from nerfnav.field import Field
from nerfnav.planner.occupancy import OccupancyConfig, OccupancyMap
from nerfnav.planner.scales import grain_of, scales_of
from nerfnav.planner.spread import Outlook, position_spread
from nerfnav.robots import Robot

_ACROSS = 4
"""Nodes of the map to the width of a body: the spread is not much less than half of it."""
_MOST_NODES = 6_000_000
_TAIL = 3.0
"""Standard deviations beyond which noise is not looked at."""
_BEYOND = 10
"""Nodes of the map beyond each border of the field's box, as dangerous as the border: nobody knows what is there."""

Danger = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Chances (nx, ny, nz), lower corner (3) [m] and nodes per metre (3), as kernels take them."""
NONE: Danger = (np.zeros((2, 2, 2), np.float32), np.zeros(3), np.ones(3))
"""Nowhere a chance."""


@dataclass(frozen=True, eq=False)
class DangerMap:
    """Chances at the nodes of a grid, trilinear between them and 0 outside. Each map is made once."""

    chances: Float[np.ndarray, "nx ny nz"]
    """From 0 to 1."""
    lower: Float[np.ndarray, "3"]
    """Lower corner [m]."""
    per_meter: Float[np.ndarray, "3"]
    """Nodes per metre."""

    @classmethod
    def of(cls, field: Field, robot: Robot, outlook: Outlook) -> "DangerMap":
        """The map of a robot in a field; made once for each spread and kept."""
        return _blurred(field, robot, outlook.height, position_spread(robot, outlook.dt, outlook.disturbance))

    @property
    def parts(self) -> Danger:
        """What kernels ask for."""
        return self.chances, self.lower, self.per_meter

    def at_voxels_of(self, occupancy: OccupancyMap) -> Float[np.ndarray, "nx ny nz"]:
        """The chances at the centres of a map's voxels."""
        first, spacing = occupancy.box.lower.double().cpu().numpy(), occupancy.spacing.double().numpy()
        shape = occupancy.by_heading.shape[1:]
        axes = [
            (first[axis] + np.arange(shape[axis]) * spacing[axis] - self.lower[axis]) * self.per_meter[axis]
            for axis in range(3)
        ]
        return scipy.ndimage.map_coordinates(self.chances, np.meshgrid(*axes, indexing="ij"), order=1)


@lru_cache(maxsize=8)
def dearer_by(danger: DangerMap, occupancy: OccupancyMap, weight: float) -> Float[np.ndarray, "nx ny nz"]:
    """What a metre costs more in each voxel of a map, for a search to whom a metre among certain hits is as dear as
    `weight` metres in the open; made once."""
    return weight * danger.at_voxels_of(occupancy)


@lru_cache(maxsize=8)
def _blurred(field: Field, robot: Robot, height: float | None, spread: tuple[float, float]) -> DangerMap:
    occupancy = _occupied(field, robot, height)
    spacing, lower = occupancy.spacing.double().numpy(), occupancy.box.lower.double().cpu().numpy()
    occupied = occupancy.dense.all(0).numpy().astype(np.float32)
    flat = height is not None
    level, rise = spread[0] / spacing, 0.0 if flat else spread[1] / spacing[2]
    chances = scipy.ndimage.gaussian_filter(occupied, (level[0], level[1], rise), mode="nearest", truncate=_TAIL)
    beyond = np.array([_BEYOND, _BEYOND, 1 if flat else _BEYOND])  # of the only layer: the same at whatever height
    chances = np.pad(chances, np.stack([beyond, beyond], -1), mode="edge")
    return DangerMap(chances, lower - beyond * spacing, 1 / spacing)


@lru_cache(maxsize=2)
def _occupied(field: Field, robot: Robot, height: float | None) -> OccupancyMap:
    """Where the body does not fit, fine enough to be blurred."""
    width, volume = scales_of(field, robot.body).width, field.box.size.double().prod().item()
    voxel = max(width / _ACROSS, grain_of(field) or 0.0, (volume / _MOST_NODES) ** (1 / 3))
    return OccupancyMap.of(field, robot.body, OccupancyConfig(voxel=voxel, samples_per_voxel=1), height)
