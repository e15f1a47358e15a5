"""Flatness map between fixed ends as a fast function with an adjoint: arrays in, arrays out, float64.

    forward:  free numbers -> positions, attitudes, actions
    backward: what a cost changes with those -> what it changes with the free numbers

The adjoint of an attitude R is a vector g in its body tangent: R -> R Exp(delta) changes the cost by g . delta.
"""

from abc import ABC, abstractmethod
from typing import Protocol, final, runtime_checkable

import numpy as np
import torch
from torch import Tensor

from nerfnav.geometry import so3
from nerfnav.robots.state import Motion, RigidState


class FlatMap(ABC):
    """Flatness map of one robot, for one start, goal, number of steps N and time step dt."""

    position: np.ndarray
    """(N + 1, 3) positions [m] of the last `forward`."""
    velocity: np.ndarray
    """(N + 1, 3) velocities [m/s] of the last `forward`."""
    rotation: np.ndarray
    """(N + 1, 3, 3) attitudes R_world_body of the last `forward`."""
    rate: np.ndarray
    """(N + 1, 3) body rates [rad/s] of the last `forward`."""
    action: np.ndarray
    """(N, a) actions of the last `forward`."""
    dt: float
    """Length of a step [s]."""
    _slopes: tuple[np.ndarray, ...] = ()  # what `limits` adds to the next `backward`, of a compiled map

    def _clear_slopes(self) -> None:
        for slope in self._slopes:
            slope[:] = 0.0

    @abstractmethod
    def forward(self, free: np.ndarray) -> None:
        """Fill position, rotation and action."""

    @abstractmethod
    def limits(self, weight: float) -> float:
        """Compute `weight` times the robot's `limits` at the last motion; the next `backward` adds its derivative."""

    @abstractmethod
    def backward(self, by_position: np.ndarray, by_rotation: np.ndarray, by_action: np.ndarray) -> np.ndarray:
        """Compute the derivative by the free numbers, from those by position, attitude (in its tangent) and action.

        The arrays may be used up as scratch.
        """

    def motion(self) -> Motion:
        """Return the last motion as tensors, in single precision."""
        arrays = (self.position, self.velocity, self.rotation, self.rate, self.action)
        *states, action = (torch.from_numpy(array.astype(np.float32)) for array in arrays)
        return Motion(RigidState(*states), action, self.dt)


@runtime_checkable
class FlatRobot(Protocol):
    """Methods of a robot that its map by autograd needs; see `Robot`."""

    def motion(self, free: Tensor, start: RigidState, goal: RigidState, steps: int, dt: float) -> Motion:
        """Compute the motion of the free numbers."""
        ...

    def limits(self, motion: Motion) -> Tensor:
        """Penalise motions that are not well defined."""
        ...


@final
class TorchFlatMap(FlatMap):
    """Flatness map of any robot by autograd: slower, and the reference for the compiled ones."""

    def __init__(self, robot: FlatRobot, start: RigidState, goal: RigidState, steps: int, dt: float) -> None:
        """Map free numbers of `robot` between `start` and `goal`."""
        self._robot, self._steps, self.dt = robot, steps, dt
        self._start, self._goal = start.to(torch.float64), goal.to(torch.float64)

    def forward(self, free: np.ndarray) -> None:
        """Implement FlatMap by autograd."""
        self._free = torch.from_numpy(free.copy()).requires_grad_()
        self._motion: Motion = self._robot.motion(self._free, self._start, self._goal, self._steps, self.dt)
        self._penalty: torch.Tensor | None = None
        states = self._motion.states.detach()
        self.position, self.velocity = states.position.numpy(), states.velocity.numpy()
        self.rotation, self.rate = states.rotation.numpy(), states.body_rate.numpy()
        self.action = self._motion.actions.detach().numpy()

    def limits(self, weight: float) -> float:
        """Implement FlatMap by autograd."""
        self._penalty = weight * self._robot.limits(self._motion)
        return self._penalty.item()

    def backward(self, by_position: np.ndarray, by_rotation: np.ndarray, by_action: np.ndarray) -> np.ndarray:
        """Implement FlatMap by autograd."""
        states = self._motion.states
        skew = so3.hat(torch.from_numpy(by_rotation))
        parts = [
            (states.position, torch.from_numpy(by_position)),
            # <R [g]x / 2, R [delta]x> = g . delta turns a tangent adjoint into one of the matrix
            (states.rotation, 0.5 * states.rotation.detach() @ skew),
            (self._motion.actions, torch.from_numpy(by_action)),
        ]
        if self._penalty is not None:
            parts.append((self._penalty, torch.ones_like(self._penalty)))
        # what the free numbers do not move, such as the attitude of a robot that never turns, has no share
        moved = [(part, weight) for part, weight in parts if part.requires_grad]
        outputs, weights = zip(*moved, strict=True)
        (gradient,) = torch.autograd.grad(outputs, self._free, weights)
        return gradient.numpy()
