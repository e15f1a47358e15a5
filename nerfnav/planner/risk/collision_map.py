"""Collision map: the chance that noise makes a body touch something, by where its plan has its centre.

    c_t(p, yaw) = P(the body, turned by yaw, does not fit at p + d),  d ~ N(0, P_t)   =   (1_blocked * N(0, P_t))(p)

with P_t of tracking_error.py after step t: where the body does not fit (configuration_space.py: the Minkowski sum of
the body and what is solid), blurred. It is the expectation of hitting the body as a whole; the same sum over body
points as in Eq. 1 would count one hit as often as there are points. P_t is the same everywhere, so that one map
serves all plans in a place. The body is taken level, and one that is about as long as wide along the world's axes:
planned with its heading, a quadrotor touched no less in the church's straits. Plans keep all of the body inside of
the field's box (space/border.py); where noise may push it a little beyond, things are taken to be as they are at the
border.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy
from jaxtyping import Bool, Float

from nerfnav.field import Field
from nerfnav.planner.risk.configuration_space import CSpace, require_map_memory
from nerfnav.planner.risk.tracking_error import RiskContext, tracking_deviations
from nerfnav.planner.space.occupancy import OccupancyMap
from nerfnav.robots import Robot

_FINE = 2
"""Nodes of the map to a standard deviation, where the obstacles are known as finely."""
_TAIL = 3.0
"""Standard deviations beyond which noise is not looked at."""
_STILL = 1e-6
"""Standard deviation that stands for none, in nodes."""
_BEYOND = 10
"""Nodes of the map beyond each border of the field's box, as dangerous as the border: nobody knows what is there."""

ChanceGrid = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Chances (k, h, nx, ny, nz), lower corner (3) [m] and nodes per metre (3), as kernels take them."""
NONE: ChanceGrid = (np.zeros((1, 1, 2, 2, 2), np.float32), np.zeros(3), np.ones(3))
"""Nowhere a chance."""


@dataclass(frozen=True, eq=False)
class CollisionMap:
    """Chances at the nodes of a grid, trilinear between them and 0 outside, and linear between headings. Each map is
    made once."""

    chances: Float[np.ndarray, "k h nx ny nz"]
    """From 0 to 1: in the first steps of a plan, one by one, the last also in all later ones; for headings evenly over
    half a turn, begun at 0, or a single one where it does not count."""
    lower: Float[np.ndarray, "3"]
    """Lower corner [m]."""
    per_meter: Float[np.ndarray, "3"]
    """Nodes per metre."""

    @classmethod
    def of(cls, field: Field, robot: Robot, risk_context: RiskContext) -> "CollisionMap":
        """The map of a robot in a field; made once for each spread and kept.

        Raises InvalidInputError where the memory cannot hold it.
        """
        return _blurred(
            field, robot, risk_context.height, tracking_deviations(robot, risk_context.dt, risk_context.disturbance)
        )

    @property
    def parts(self) -> ChanceGrid:
        """What kernels ask for."""
        return self.chances, self.lower, self.per_meter

    @property
    def later(self) -> ChanceGrid:
        """The same, with chances as they are once noise has grown, from the first step on."""
        return self.chances[-1:], self.lower, self.per_meter

    def sample_voxels(self, occupancy: OccupancyMap) -> Float[np.ndarray, "m nx ny nz"]:
        """The chances at the centres of a map's voxels with each of its headings, once noise has grown; with the best
        one where it does not tell them apart."""
        first, spacing = occupancy.box.lower.double().cpu().numpy(), occupancy.spacing.double().numpy()
        count, *shape = occupancy.by_heading.shape
        axes = [
            (first[axis] + np.arange(shape[axis]) * spacing[axis] - self.lower[axis]) * self.per_meter[axis]
            for axis in range(3)
        ]
        centres = np.meshgrid(*axes, indexing="ij")
        turned = [self._turned(turn / count) for turn in range(count)] if count > 1 else [self.chances[-1].min(0)]
        return np.stack([scipy.ndimage.map_coordinates(chances, centres, order=1) for chances in turned])

    def _turned(self, share: float) -> Float[np.ndarray, "nx ny nz"]:
        """The last chances with a heading, in shares of half a turn below 1."""
        layer = self.chances[-1]
        below = int(share * len(layer))
        rest = share * len(layer) - below
        return (1 - rest) * layer[below] + rest * layer[(below + 1) % len(layer)]


@lru_cache(maxsize=8)
def relative_cost(danger: CollisionMap, occupancy: OccupancyMap, weight: float) -> Float[np.ndarray, "m nx ny nz"]:
    """What a metre costs more in each voxel of a map with each of its headings, for a search to whom a metre among
    certain hits is as dear as `weight` metres in the open; made once."""
    return weight * danger.sample_voxels(occupancy)


@lru_cache(maxsize=8)
def _blurred(
    field: Field, robot: Robot, height: float | None, spreads: tuple[tuple[float, float], ...]
) -> CollisionMap:
    space = _c_space(field, robot, height)
    if height is None and len(space.by_heading) > 1:
        spreads = spreads[-1:]  # headings take memory enough; in the first steps that is too careful
    deviations = np.array([(level, level, tall) for level, tall in spreads])
    spacing = np.maximum(space.spacing, deviations[-1] / _FINE)
    lower, blurred = space.lower.copy(), 3 if height is None else 2
    places, (headings, *counts) = [], space.by_heading.shape
    for count, step, node in zip(counts, space.spacing, spacing, strict=True):
        beyond = _BEYOND * node
        places.append(np.arange(math.ceil(((count - 1) * step + 2 * beyond) / node) + 1) * node - beyond)
    lower[:blurred] -= _BEYOND * spacing[:blurred]
    shape = (len(spreads), headings, *map(len, places[:blurred]), *counts[blurred:])
    require_map_memory(
        np.dtype(np.float32).itemsize * math.prod(shape),
        f"at {math.prod(shape[2:]):,} points in {len(spreads)} steps with {headings} headings",
    )
    chances = np.empty(shape, np.float32)  # filled one by one: it may take most of the memory
    for layer, spread in zip(chances, deviations, strict=True):
        weights = [
            _weights(np.clip(at / step, 0, count - 1), count, max(deviation / step, _STILL))
            for at, step, count, deviation in zip(places[:blurred], space.spacing, counts, spread, strict=False)
        ]
        for turned, blocked in zip(layer, space.by_heading, strict=True):
            turned[:] = _layer(blocked, weights)
    if height is not None:  # the same at whatever height
        chances, lower[2] = np.repeat(chances, 3, -1), lower[2] - spacing[2]
    return CollisionMap(chances, lower, 1 / spacing)


def _layer(
    blocked: Bool[np.ndarray, "nx ny nz"], weights: list[Float[np.ndarray, "_m _n"]]
) -> Float[np.ndarray, "mx my mz"]:
    """Obstacles blurred along one axis after the other, with what each node has around each place there."""
    chances = blocked.astype(np.float32)
    for axis, along in enumerate(weights):
        chances = np.moveaxis(np.tensordot(along, chances, (1, axis)), 0, axis)
    return chances


def _weights(places: Float[np.ndarray, " m"], count: int, deviation: float) -> Float[np.ndarray, "m n"]:
    """What each of `count` nodes has of a normal distribution around each place, in nodes: that of the cell around it,
    to the tail."""
    edges, tail = np.arange(count + 1) - 0.5, scipy.special.ndtr(-_TAIL)
    below = scipy.special.ndtr(np.clip((edges - places[:, None]) / deviation, -_TAIL, _TAIL))
    below = (below - tail) / (1 - 2 * tail)
    below[:, 0], below[:, -1] = 0.0, 1.0  # beyond the border it is as at the border
    return np.diff(below).astype(np.float32)


@lru_cache(maxsize=2)
def _c_space(field: Field, robot: Robot, height: float | None) -> CSpace:
    """Where the body does not fit; kept, for robots that are pushed by different noise."""
    return CSpace.of(field, robot.body, height)
