"""The differential drive's compiled flatness map."""

import math
from typing import final

import numpy as np
import torch

from nerfnav.robots.arcs import EXACT, ROUNDS
from nerfnav.robots.diffdrive_config import DiffDriveConfig
from nerfnav.robots.flat_map import FlatMap
from nerfnav.robots.ground import forward_speed, heading
from nerfnav.robots.kernels import arcs
from nerfnav.robots.kernels import diffdrive as kernels
from nerfnav.robots.state import RigidState


@final
class DiffDriveMap(FlatMap):
    """Free numbers of a differential drive to its motion, and back."""

    def __init__(self, config: DiffDriveConfig, start: RigidState, goal: RigidState, steps: int, dt: float) -> None:
        """Map the free numbers of a robot with these constants between `start` and `goal`."""
        self.dt = dt
        start, goal = start.to(torch.float64), goal.to(torch.float64)
        self._ends = np.array([_end(state) for state in (start, goal)])
        self._goal = goal.position.numpy()
        self._bounds = np.array(
            [config.max_speed, config.max_yaw_rate, config.max_acceleration, config.max_yaw_acceleration]
        )
        self._iterates = np.empty((ROUNDS + 1, 2 * steps - 3))
        self._speeds = np.empty(steps + 1)
        self.position, self.velocity, self.rate = np.zeros((3, steps + 1, 3))
        self.position[:, 2], self.velocity[0] = start.position[2].item(), start.velocity.numpy()
        self.rotation, self.action = np.empty((steps + 1, 3, 3)), np.empty((steps, 2))
        self._slopes = (np.zeros(steps + 1), np.zeros(steps + 1), np.zeros((steps, 2)))

    def forward(self, free: np.ndarray) -> None:
        """See FlatMap."""
        self._clear()
        short = self._ends[1, 2] - free[-1]
        self._last = free[-1] + math.atan2(math.sin(short), math.cos(short))
        self._rounds = arcs.close(free, self._ends, self._last, self.dt, self._iterates)
        kernels.motion(
            self._iterates[self._rounds], self._ends, self._last, self.dt, self._speeds, self.position,
            self.velocity, self.rotation, self.rate, self.action,
        )  # fmt: skip
        self._reached = bool(np.linalg.norm(self.position[-1, :2] - self._goal[:2]) < EXACT)
        self.position[-1, 2] = self.position[0, 2]
        if self._reached:
            self.position[-1] = self._goal

    def limits(self, weight: float) -> float:
        """See FlatMap."""
        self._clear()
        return kernels.limits(self._speeds, self.rate, self.action, self._bounds, weight, *self._slopes)

    def backward(self, by_position: np.ndarray, by_rotation: np.ndarray, by_action: np.ndarray) -> np.ndarray:
        """See FlatMap."""
        of_speed, of_rate, of_action = self._slopes
        if self._reached:  # the goal does not move
            by_position[-1] = 0.0
        gradient = np.empty(self._iterates.shape[1])
        kernels.adjoint(
            self._iterates, self._rounds, self._ends, self._last, self.dt, by_position, by_rotation,
            of_speed.copy(), of_rate.copy(), by_action + of_action, gradient,
        )  # fmt: skip
        return gradient

    def _clear(self) -> None:
        for slope in self._slopes:
            slope[:] = 0.0


def _end(state: RigidState) -> list[float]:
    return [
        *state.position[:2].tolist(), heading(state).item(), forward_speed(state).item(), state.body_rate[2].item()
    ]  # fmt: skip
