"""J and its gradient by the free numbers, compiled: what the fast planner minimises.

The terms are those of costs.py, which stays the reference; tests hold both equal.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
import torch
from torch import Tensor

from nerfnav.field.field import FastDensity, Field, density_and_gradient
from nerfnav.planner.costs import CostWeights
from nerfnav.planner.kernels import collision as kernels
from nerfnav.planner.steps import PlanCost
from nerfnav.robots.flat_map import FlatMap
from nerfnav.robots.robot import Robot
from nerfnav.robots.state import Motion

ExtraTerm = Callable[[Motion], Tensor]
"""A motion to a differentiable number that is added to J."""


@dataclass(frozen=True)
class Evaluation:
    """J at one point of the search."""

    free: np.ndarray
    """The free numbers (k)."""
    cost: PlanCost
    """The terms of J."""
    gradient: np.ndarray
    """dJ / d free (k)."""


@dataclass(frozen=True)
class Extra:
    """Terms that are not compiled, by autograd: slower by a millisecond or more."""

    terms: tuple[ExtraTerm, ...]
    """What to add to J."""
    motion: Callable[[Tensor], Motion]
    """Free numbers to a motion, both in double precision."""

    def __call__(self, free: np.ndarray) -> tuple[float, np.ndarray]:
        """Their sum and its derivative by the free numbers (k)."""
        at = torch.from_numpy(free.copy()).requires_grad_()
        motion = self.motion(at)
        total = torch.stack([term(motion).double() for term in self.terms]).sum()
        if not total.requires_grad:
            return total.item(), np.zeros_like(free)
        (gradient,) = torch.autograd.grad(total, at)
        return total.item(), gradient.numpy()


class Objective:
    """J of Eq. 2 for one robot between fixed ends in one field."""

    def __init__(
        self,
        field: Field,
        robot: Robot,
        flat_map: FlatMap,
        weights: CostWeights,
        points: int | None = None,
        extra: Extra | None = None,
    ) -> None:
        """Weigh the motions of `flat_map` as `weights` say, with all or only so many well spread body points."""
        self._map, self._weights, self._extra = flat_map, weights, extra
        fast = isinstance(field, FastDensity)  # asked once: it takes as long as the densities of a coarse body
        self._density = field.density_and_gradient if fast else partial(density_and_gradient, field)
        points_body = robot.body_with_room(weights.margin).points_body.double().numpy()
        self._points_body = points_body if points is None else well_spread(points_body, points)
        parts = weights.samples_per_step
        self._fractions = (np.arange(parts) + 0.5) / parts
        self._gamma = weights.control * np.array(robot.action_weights)
        self._box = tuple(edge.double().cpu().numpy() for edge in (field.box.lower, field.box.upper))
        self._world, self._samples = np.empty((0, 0, 3)), np.empty((0, 0, 0, 3))

    def __call__(self, free: np.ndarray) -> Evaluation:
        """J with all its terms."""
        by_position, by_rotation, by_action = self._forward(free)
        limits, effort = self._penalties(by_position, by_rotation, by_action)
        met = self._collision(by_position, by_rotation)
        gradient = self._map.backward(by_position, by_rotation, by_action)
        added = 0.0
        if self._extra is not None:
            added, slope = self._extra(free)
            gradient = gradient + slope
        return Evaluation(free, PlanCost(met, effort, limits, added), gradient)

    def effort_gradient(self, free: np.ndarray) -> np.ndarray:
        """The gradient of J without the collision and extra terms: cheap, and most of the curvature of J."""
        by = self._forward(free)
        self._penalties(*by)
        return self._map.backward(*by)

    def _forward(self, free: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        self._map.forward(free)
        position = self._map.position
        return np.zeros_like(position), np.zeros_like(position), np.zeros_like(self._map.action)

    def _penalties(
        self, by_position: np.ndarray, by_rotation: np.ndarray, by_action: np.ndarray
    ) -> tuple[float, float]:
        effort = kernels.control(self._map.action, self._gamma, by_action)
        strayed = kernels.outside(self._map.position, *self._box, self._weights.outside, by_position)
        return strayed + self._map.limits(self._weights.limits), effort

    def _collision(self, by_position: np.ndarray, by_rotation: np.ndarray) -> float:
        motion, count = self._map, len(self._points_body)
        times, parts = len(motion.position), len(self._fractions)
        if len(self._world) != times:
            self._world, self._samples = np.empty((times, count, 3)), np.empty((times - 1, count, parts, 3))
        kernels.spread(
            motion.position, motion.rotation, self._points_body, self._fractions, self._world, self._samples
        )
        density, slope = self._density(self._samples.reshape(-1, 3))
        return kernels.collision(
            motion.rotation, self._points_body, self._fractions, self._world, density.reshape(self._samples.shape[:3]),
            slope.reshape(self._samples.shape), self._weights.collision, by_position, by_rotation,
        )  # fmt: skip


def well_spread(points: np.ndarray, count: int) -> np.ndarray:
    """So many of the points (n, 3), each the farthest from those before it, the outermost first (Gonzalez, 1985)."""
    distance = -np.square(points - points.mean(0)).sum(-1)
    chosen = [int(distance.argmin())]
    distance = np.square(points - points[chosen[0]]).sum(-1)
    while len(chosen) < min(count, len(points)):
        chosen.append(int(distance.argmax()))
        distance = np.minimum(distance, np.square(points - points[chosen[-1]]).sum(-1))
    return np.ascontiguousarray(points[chosen])
