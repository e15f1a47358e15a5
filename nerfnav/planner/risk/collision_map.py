"""Collision map: the probability that noise makes a body touch something, by the planned place of its centre.

    c_t(p, yaw) = P(the body, turned by yaw, does not fit at p + d),  d ~ N(0, P_t)   =   (1_blocked * N(0, P_t))(p)

with P_t of tracking_error.py after step t: the configuration-space obstacles (configuration_space.py: the Minkowski
sum of the body and the solid space), blurred. It is the expectation of hitting the body as a whole; the same sum over
body points as in Eq. 1 would count one hit as often as there are points. P_t is the same everywhere, so that one map
serves all plans in a place. The body is taken level, and one that is about as long as wide along the world's axes:
planned with its heading, a quadrotor touched no less in the church's straits. Plans keep all of the body inside of
the field's box (space/border.py); where noise may push it a little beyond, space counts as it is at the border.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy
from jaxtyping import Bool, Float, Int

from nerfnav.field import Field, origin_of
from nerfnav.planner.kernels import terms as kernels
from nerfnav.planner.kernels.maps import weigh
from nerfnav.planner.risk.configuration_space import CSpace, require_map_memory
from nerfnav.planner.risk.tracking_error import Deviation, RiskContext, tracking_deviations
from nerfnav.planner.space.occupancy import OccupancyMap
from nerfnav.robots import RigidState, Robot

_FINE = 2
"""Nodes of the map to a standard deviation, where the obstacles are known as finely."""
_TAIL = 3.0
"""Standard deviations at which the normal distribution is cut off."""
_STILL = 1e-6
"""Standard deviation that stands for none, in nodes."""
_BEYOND = 10
"""Nodes of the map beyond each border of the field's box, with the chances at the border."""

ChanceGrid = tuple[np.ndarray, np.ndarray, np.ndarray, float]
"""Chances (k, h, nx, ny, nz), lower corner (3) [m], nodes per metre (3), and the chance that counts as none, as kernels
take them."""
NO_CHANCE: ChanceGrid = (np.zeros((1, 1, 2, 2, 2), np.float32), np.zeros(3), np.ones(3), 0.0)
"""Grid without any chance of a collision."""


@dataclass(frozen=True, eq=False)
class CollisionMap:
    """Chances of a collision at the nodes of a grid, trilinear between them and 0 outside, linear between headings."""

    chances: Float[np.ndarray, "k h nx ny nz"]
    """From 0 to 1: in the first steps of a plan, one by one, the last also in all later ones; for headings evenly over
    half a turn, begun at 0, or a single one where it does not count."""
    lower: Float[np.ndarray, "3"]
    """Lower corner [m]."""
    per_meter: Float[np.ndarray, "3"]
    """Nodes per metre."""

    @classmethod
    def of(cls, field: Field, robot: Robot, context: RiskContext) -> "CollisionMap":
        """Make the map of a robot in a field, once for each covariance.

        Raises InvalidInputError where the memory cannot hold it.
        """
        return _blur(field, robot, context.height, tracking_deviations(robot, context.dt, context.noise))

    def grid(self, context: RiskContext) -> ChanceGrid:
        """Return the grid as kernels take it, for plans in a context."""
        accepted = 0.0 if context.end is None else kernels.interpolate_chance(self._late, 0, *context.end)[0]
        return self.chances, self.lower, self.per_meter, accepted

    @property
    def _late(self) -> ChanceGrid:
        """Chances of late steps, once noise has grown."""
        return self.chances[-1:], self.lower, self.per_meter, 0.0

    def gradient_at(self, state: RigidState) -> Float[np.ndarray, "3"]:
        """Differentiate the chance of late steps, once noise has grown, by the position of a state [1/m]."""
        position, rotation = (np.repeat(part.double().numpy()[None], 2, 0) for part in (state.position, state.rotation))
        gradient = np.zeros((2, 3))
        kernels.risk(position, rotation, np.array([0.5]), self._late, 0.0, 1.0, gradient, np.zeros((2, 3)))
        return gradient.sum(0)

    def sample_voxels(self, occupancy: OccupancyMap) -> Float[np.ndarray, "m nx ny nz"]:
        """Sample the chances of late steps at the centres of an occupancy map's voxels with each of its headings; with
        the best heading where that map does not tell them apart."""
        first, spacing = occupancy.box.lower.double().cpu().numpy(), occupancy.spacing.double().numpy()
        count, *shape = occupancy.by_heading.shape
        axes = [
            (first[axis] + np.arange(shape[axis]) * spacing[axis] - self.lower[axis]) * self.per_meter[axis]
            for axis in range(3)
        ]
        turned = [self._turn(turn / count) for turn in range(count)] if count > 1 else [self.chances[-1].min(0)]
        return np.stack([_interpolate(chances, axes) for chances in turned])

    def _turn(self, share: float) -> Float[np.ndarray, "nx ny nz"]:
        """Interpolate the last chances at a heading, in shares of half a turn below 1."""
        layer = self.chances[-1]
        below = int(share * len(layer))
        rest = share * len(layer) - below
        return (1 - rest) * layer[below] + rest * layer[(below + 1) % len(layer)]


@lru_cache(maxsize=8)
def relative_cost(chances: CollisionMap, occupancy: OccupancyMap, weight: float) -> Float[np.ndarray, "m nx ny nz"]:
    """Compute the extra cost of a metre in each voxel of an occupancy map with each of its headings: `weight` metres in
    the open where noise hits something for certain."""
    return weight * chances.sample_voxels(occupancy)


@lru_cache(maxsize=6)
def _blur(field: Field, robot: Robot, height: float | None, deviations: tuple[Deviation, ...]) -> CollisionMap:
    space = cached_c_space(field, robot, height)
    if height is None and len(space.by_heading) > 1:
        deviations = deviations[-1:]  # headings take memory enough; in the first steps that is too careful
    by_axis = np.array([(each.level, each.level, each.height) for each in deviations])
    spacing = np.maximum(space.spacing, by_axis[-1] / _FINE)
    lower, blurred = space.lower.copy(), 3 if height is None else 2
    places, (headings, *counts) = [], space.by_heading.shape
    for count, step, node in zip(counts, space.spacing, spacing, strict=True):
        beyond = _BEYOND * node
        places.append(np.arange(math.ceil(((count - 1) * step + 2 * beyond) / node) + 1) * node - beyond)
    lower[:blurred] -= _BEYOND * spacing[:blurred]
    shape = (len(by_axis), headings, *map(len, places[:blurred]), *counts[blurred:])
    require_map_memory(
        np.dtype(np.float32).itemsize * math.prod(shape),
        f"at {math.prod(shape[2:]):,} points in {len(by_axis)} steps with {headings} headings",
    )
    before = origin_of(field) if height is None else None
    if before is None:
        chances = np.empty(shape, np.float32)  # filled one by one: it may take most of the memory
        changed = [slice(None)] * blurred
    else:
        chances = _blur(before[0], robot, None, deviations).chances.copy()
        around = before[1].grown(robot.body.radius + _TAIL * by_axis.max() + 2 * spacing.max())
        changed = around.window(lower, spacing, shape[2:])
    for layer, along_axes in zip(chances, by_axis, strict=True):
        weights = [
            _weights(np.clip(at / step, 0, count - 1), count, max(deviation / step, _STILL))[part]
            for at, step, count, deviation, part in zip(
                places[:blurred], space.spacing, counts, along_axes, changed, strict=False
            )
        ]
        near = [_used(along) for along in weights]
        for turned, blocked in zip(layer, space.by_heading, strict=True):
            part = blocked[tuple(near)]
            turned[tuple(changed)] = _layer(part, [along[:, used] for along, used in zip(weights, near, strict=True)])
    if height is not None:  # the same at whatever height
        chances, lower[2] = np.repeat(chances, 3, -1), lower[2] - spacing[2]
    return CollisionMap(chances, lower, 1 / spacing)


def _interpolate(
    values: Float[np.ndarray, "nx ny nz"], axes: list[Float[np.ndarray, " _m"]]
) -> Float[np.ndarray, "mx my mz"]:
    """Interpolate linearly at the places of a grid, which are nodes along each axis, one axis after the other."""
    for axis, places in enumerate(axes):
        below = np.clip(places.astype(int), 0, values.shape[axis] - 2)
        rest = (places - below).clip(0, 1).astype(np.float32)
        values = _weigh_along(values, axis, below, np.stack([1 - rest, rest], -1))
    return values


def _layer(
    blocked: Bool[np.ndarray, "nx ny nz"], weights: list[Float[np.ndarray, "_m _n"]]
) -> Float[np.ndarray, "mx my mz"]:
    """Blur obstacles along one axis after the other, with the weights of their nodes around each place."""
    chances = blocked.astype(np.float32)
    for axis, along in enumerate(weights):
        chances = _weigh_along(chances, axis, *_near(along))
    return chances


def _weigh_along(
    values: Float[np.ndarray, "nx ny nz"],
    axis: int,
    first: Int[np.ndarray, " _m"],
    weights: Float[np.ndarray, "_m _w"],
) -> Float[np.ndarray, "mx my mz"]:
    """Sum the nodes first[k], first[k] + 1, ... along an axis with the weights of each place k."""
    shape = values.shape[:axis], values.shape[axis + 1 :]
    result = np.empty((math.prod(shape[0]), len(first), math.prod(shape[1])), np.float32)
    weigh(values.reshape(len(result), -1, result.shape[2]), first, weights, result)
    return result.reshape(*shape[0], -1, *shape[1])


def _near(weights: Float[np.ndarray, "m n"]) -> tuple[Int[np.ndarray, " m"], Float[np.ndarray, "m _w"]]:
    """Find the first node of each place that has a weight, and the weights from there on, as many for each place."""
    count, some = weights.shape[1], weights != 0
    first, end = some.argmax(1), count - some[:, ::-1].argmax(1)
    width = int((end - first)[some.any(1)].max(initial=1))
    first = np.minimum(first, count - width)
    return first, np.take_along_axis(weights, first[:, None] + np.arange(width), 1)


def _weights(places: Float[np.ndarray, " m"], count: int, deviation: float) -> Float[np.ndarray, "m n"]:
    """Integrate a normal distribution around each place, in nodes, over the cells of `count` nodes, to the tail."""
    edges, tail = np.arange(count + 1) - 0.5, scipy.special.ndtr(-_TAIL)
    below = scipy.special.ndtr(np.clip((edges - places[:, None]) / deviation, -_TAIL, _TAIL))
    below = (below - tail) / (1 - 2 * tail)
    below[:, 0], below[:, -1] = 0.0, 1.0  # beyond the border it is as at the border
    return np.diff(below).astype(np.float32)


def _used(weights: Float[np.ndarray, "m n"]) -> slice:
    """Find the nodes that have a weight anywhere."""
    used = np.flatnonzero((weights != 0).any(0))
    return slice(int(used[0]), int(used[-1]) + 1) if len(used) else slice(0, 0)


@lru_cache(maxsize=3)
def cached_c_space(field: Field, robot: Robot, height: float | None) -> CSpace:
    """Compute the obstacles of a robot in a field, once for all covariances; see `CSpace.of`."""
    before = origin_of(field) if height is None else None
    if before is not None:
        return cached_c_space(before[0], robot, None).updated(field, robot.body, before[1])
    return CSpace.of(field, robot.body, height)
