"""The chance that noise makes a body touch something, by where its plan has its centre.

    c(p) = P(the body does not fit at p + d),  d ~ N(0, P)   =   (1_occupied * N(0, P))(p)

with P of spread.py: where the body does not fit (occupancy.py: the Minkowski sum of the body and what is solid),
blurred. It is the expectation of hitting the body as a whole; the same sum over body points as in Eq. 1 would count one
hit as often as there are points. P is the same everywhere, so that one map serves all plans in a place. The body is
taken level, and of one that is longer than wide its best heading.
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

Danger = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Chances (nx, ny, nz), lower corner (3) [m] and nodes per metre (3), as kernels take them."""
NONE: Danger = (np.zeros((2, 2, 2), np.float32), np.zeros(3), np.ones(3))
"""Nowhere a chance."""


@dataclass(frozen=True)
class DangerMap:
    """Chances at the nodes of a grid, trilinear between them and 0 outside."""

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


@lru_cache(maxsize=8)
def _blurred(field: Field, robot: Robot, height: float | None, spread: tuple[float, float]) -> DangerMap:
    occupancy = _occupied(field, robot, height)
    spacing, lower = occupancy.spacing.double().numpy(), occupancy.box.lower.double().cpu().numpy()
    occupied = occupancy.occupied.numpy().astype(np.float32)
    flat = height is not None
    level, rise = spread[0] / spacing, 0.0 if flat else spread[1] / spacing[2]
    chances = scipy.ndimage.gaussian_filter(occupied, (level[0], level[1], rise), mode="nearest", truncate=_TAIL)
    if flat:  # a cell on either side of the only layer: the same at whatever height
        chances, lower, spacing = np.repeat(chances, 3, -1), lower - [0.0, 0.0, spacing[2]], spacing
    return DangerMap(np.ascontiguousarray(chances), lower, 1 / spacing)


@lru_cache(maxsize=2)
def _occupied(field: Field, robot: Robot, height: float | None) -> OccupancyMap:
    """Where the body does not fit, fine enough to be blurred."""
    width, volume = scales_of(field, robot.body).width, field.box.size.double().prod().item()
    voxel = max(width / _ACROSS, grain_of(field) or 0.0, (volume / _MOST_NODES) ** (1 / 3))
    return OccupancyMap.of(field, robot.body, OccupancyConfig(voxel=voxel, samples_per_voxel=1), height)
