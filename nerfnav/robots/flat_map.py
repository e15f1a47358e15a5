"""A robot's flatness map between fixed ends as a fast function with an adjoint: arrays in, arrays out, float64.

    forward:  free numbers -> positions, attitudes, actions
    backward: what a cost changes with those -> what it changes with the free numbers

The adjoint of an attitude R is a vector g in its body tangent: R -> R Exp(delta) changes the cost by g . delta.
"""

from abc import ABC, abstractmethod
from typing import final

import numpy as np
import torch

from nerfnav.geometry import so3
from nerfnav.robots.robot import Robot
from nerfnav.robots.state import Motion, RigidState


class FlatMap(ABC):
    """The flatness map of one robot, for one start, goal, number of steps N and time step dt."""

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

    @abstractmethod
    def forward(self, free: np.ndarray) -> None:
        """Fill position, rotation and action."""

    @abstractmethod
    def limits(self, weight: float, by_rotation: np.ndarray, by_action: np.ndarray) -> float:
        """`weight` times the robot's `limits` at the last motion; adds its derivatives to the given arrays."""

    @abstractmethod
    def backward(self, by_position: np.ndarray, by_rotation: np.ndarray, by_action: np.ndarray) -> np.ndarray:
        """Derivative by the free numbers, from those by position, attitude (in its tangent) and action.

        The arrays may be used up as scratch.
        """

    def motion(self) -> Motion:
        """The last motion as tensors, in single precision."""
        arrays = (self.position, self.velocity, self.rotation, self.rate, self.action)
        *states, action = (torch.from_numpy(array.astype(np.float32)) for array in arrays)
        return Motion(RigidState(*states), action, self.dt)


@final
class TorchFlatMap(FlatMap):
    """Any robot's map by autograd: slower, and the reference for the compiled ones."""

    def __init__(self, robot: Robot, start: RigidState, goal: RigidState, steps: int, dt: float) -> None:
        """Map free numbers of `robot` between `start` and `goal`."""
        self._robot, self._steps, self.dt = robot, steps, dt
        self._start, self._goal = start.to(torch.float64), goal.to(torch.float64)

    def forward(self, free: np.ndarray) -> None:
        """See FlatMap."""
        self._free = torch.from_numpy(free.copy()).requires_grad_()
        self._motion: Motion = self._robot.motion(self._free, self._start, self._goal, self._steps, self.dt)
        states = self._motion.states.detach()
        self.position, self.velocity = states.position.numpy(), states.velocity.numpy()
        self.rotation, self.rate = states.rotation.numpy(), states.body_rate.numpy()
        self.action = self._motion.actions.detach().numpy()

    def limits(self, weight: float, by_rotation: np.ndarray, by_action: np.ndarray) -> float:
        """See FlatMap."""
        rotation = self._motion.states.rotation.detach()
        tangent = torch.zeros(rotation.shape[:-1], dtype=torch.float64, requires_grad=True)
        actions = self._motion.actions.detach().requires_grad_()
        states = RigidState(
            self._motion.states.position.detach(),
            self._motion.states.velocity.detach(),
            so3.retract(rotation, tangent),
            self._motion.states.body_rate.detach(),
        )
        cost = weight * self._robot.limits(Motion(states, actions, self.dt))
        if cost.requires_grad:
            by_tangent, by_actions = torch.autograd.grad(cost, (tangent, actions), allow_unused=True)
            by_rotation += 0 if by_tangent is None else by_tangent.numpy()
            by_action += 0 if by_actions is None else by_actions.numpy()
        return cost.item()

    def backward(self, by_position: np.ndarray, by_rotation: np.ndarray, by_action: np.ndarray) -> np.ndarray:
        """See FlatMap."""
        states = self._motion.states
        skew = so3.hat(torch.from_numpy(by_rotation))
        outputs = (states.position, states.rotation, self._motion.actions)
        # <R [g]x / 2, R [delta]x> = g . delta turns a tangent adjoint into one of the matrix
        weights = (torch.from_numpy(by_position), 0.5 * states.rotation.detach() @ skew, torch.from_numpy(by_action))
        (gradient,) = torch.autograd.grad(outputs, self._free, weights)
        return gradient.numpy()
