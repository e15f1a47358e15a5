"""J and its gradient by the free numbers, compiled: what the fast planner minimises.

The terms are those of costs.py, which stays the reference; tests hold both equal.
"""

from dataclasses import dataclass

import numpy as np

from nerfnav.field.field import Field, density_and_gradient
from nerfnav.planner.costs import CostWeights
from nerfnav.planner.kernels import collision as kernels
from nerfnav.planner.steps import PlanCost
from nerfnav.robots.flat_map import FlatMap
from nerfnav.robots.robot import Robot


@dataclass(frozen=True)
class Evaluation:
    """J at one point of the search."""

    free: np.ndarray
    """The free numbers (k)."""
    cost: PlanCost
    """The terms of J."""
    gradient: np.ndarray
    """dJ / d free (k)."""


class Objective:
    """J of Eq. 2 for one robot between fixed ends in one field."""

    def __init__(self, field: Field, robot: Robot, flat_map: FlatMap, steps: int, weights: CostWeights) -> None:
        """Weigh the motions of `flat_map`, which has `steps` steps, as `weights` say."""
        self._field, self._map, self._weights = field, flat_map, weights
        self._points_body = robot.body.grown(weights.margin).points_body.double().numpy()
        parts = weights.samples_per_step
        self._fractions = (np.arange(parts) + 0.5) / parts
        self._gamma = weights.control * np.array(robot.action_weights)
        self._box = tuple(edge.double().cpu().numpy() for edge in (field.box.lower, field.box.upper))
        count = len(self._points_body)
        self._world = np.empty((steps + 1, count, 3))
        self._samples = np.empty((steps, count, parts, 3))

    def __call__(self, free: np.ndarray) -> Evaluation:
        """J with all its terms."""
        by_position, by_rotation, by_action = self._forward(free)
        limits, effort = self._penalties(by_position, by_rotation, by_action)
        motion = self._map
        kernels.spread(
            motion.position, motion.rotation, self._points_body, self._fractions, self._world, self._samples
        )
        density, slope = density_and_gradient(self._field, self._samples.reshape(-1, 3))
        met = kernels.collision(
            motion.rotation, self._points_body, self._fractions, self._world, density.reshape(self._samples.shape[:3]),
            slope.reshape(self._samples.shape), self._weights.collision, by_position, by_rotation,
        )  # fmt: skip
        gradient = motion.backward(by_position, by_rotation, by_action)
        return Evaluation(free, PlanCost(met, effort, limits), gradient)

    def effort_gradient(self, free: np.ndarray) -> np.ndarray:
        """The gradient of J without the collision term: cheap, and most of the curvature of J."""
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
        return strayed + self._map.limits(self._weights.limits, by_rotation, by_action), effort
