"""The couch's compiled flatness map."""

from typing import final

import numpy as np
import torch

from nerfnav.robots.couch_config import CouchConfig
from nerfnav.robots.flat_map import FlatMap
from nerfnav.robots.ground import heading
from nerfnav.robots.kernels import couch as kernels
from nerfnav.robots.state import RigidState


@final
class CouchMap(FlatMap):
    """Free numbers of a couch to its motion, and back."""

    def __init__(self, config: CouchConfig, start: RigidState, goal: RigidState, steps: int, dt: float) -> None:
        """Map the free numbers of a robot with these constants between `start` and `goal`."""
        self.dt, self._count = dt, 3 * (steps - 2)
        self._ends = np.stack([_end(state) for state in (start, goal)])
        self._constants = np.array([config.mass, config.inertia, dt, start.position[2].item()])
        self._bounds = np.array([config.max_speed, config.max_yaw_rate, config.max_force])
        self.position, self.velocity, self.rate = np.empty((3, steps + 1, 3))
        self.rotation, self.action = np.empty((steps + 1, 3, 3)), np.empty((steps, 3))
        self._slopes = (np.zeros((steps + 1, 2)), np.zeros(steps + 1), np.zeros((steps, 3)))

    def forward(self, free: np.ndarray) -> None:
        """See FlatMap."""
        for slope in self._slopes:
            slope[:] = 0.0
        kernels.motion(
            free, self._ends, self._constants, self.position, self.velocity, self.rotation, self.rate, self.action
        )

    def limits(self, weight: float) -> float:
        """See FlatMap."""
        for slope in self._slopes:
            slope[:] = 0.0
        return kernels.limits(self.velocity, self.rate, self.action, self._bounds, weight, *self._slopes)

    def backward(self, by_position: np.ndarray, by_rotation: np.ndarray, by_action: np.ndarray) -> np.ndarray:
        """See FlatMap."""
        of_velocity, of_rate, of_action = self._slopes
        gradient = np.empty(self._count)
        kernels.adjoint(
            self._constants, by_position, by_rotation, of_velocity.copy(), of_rate.copy(), by_action + of_action,
            gradient,
        )  # fmt: skip
        return gradient


def _end(state: RigidState) -> np.ndarray:
    state = state.to(torch.float64)
    planar = [state.position[:2].numpy(), state.velocity[:2].numpy()]
    return np.concatenate([*planar, [heading(state).item(), state.body_rate[2].item()]])
