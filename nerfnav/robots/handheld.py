"""Handheld camera: it keeps its velocities but for what the hand does, which nothing reports.

Notation as in robots/state.py. Constant-velocity model over a step dt, without any action:

    p' = p + v dt,   v' = v,   R' = R Exp(w dt),   w' = w

What the hand does is process noise (`RandomAcceleration`, see noise.py).
"""

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry import so3
from nerfnav.robots.body import Body
from nerfnav.robots.robot import Robot
from nerfnav.robots.state import Motion, RigidState

_EXTENTS = (0.1, 0.1, 0.1)


class HandHeld(Robot):
    """What is tracked, and never planned for."""

    action_names = ()
    action_weights = ()
    minimum_steps = 1

    def __init__(self, name: str = "handheld", body: Body | None = None) -> None:
        """A camera in a hand (default: of 10 cm)."""
        self.name = name
        self.body = Body.box(_EXTENTS, (3, 3, 3)) if body is None else body

    def require_planned(self) -> None:
        """Raises InvalidInputError, always."""
        raise self._never()

    def step(self, state: RigidState, action: Float[Tensor, "*batch 0"], dt: float) -> RigidState:
        """The state after `dt` [s] of moving on."""
        return RigidState(
            state.position + state.velocity * dt,
            state.velocity,
            so3.retract(state.rotation, state.body_rate * dt),
            state.body_rate,
        )

    def hold(self, state: RigidState, dt: float, turn: float = 0.0) -> Float[Tensor, " 0"]:
        """Nothing: a hand is not told what to do."""
        return torch.zeros(0)

    def motion(
        self, free: Float[Tensor, "*batch k"], start: RigidState, goal: RigidState, steps: int, dt: float
    ) -> Motion:
        """Raises InvalidInputError, always."""
        raise self._never()

    def encode(
        self, waypoints: Float[Tensor, "times 4"], start: RigidState, goal: RigidState, dt: float
    ) -> Float[Tensor, " k"]:
        """Raises InvalidInputError, always."""
        raise self._never()

    def check_ends(self, start: RigidState, goal: RigidState) -> None:
        """Raises InvalidInputError, always: planners ask this first."""
        raise self._never()

    def _never(self) -> InvalidInputError:
        return InvalidInputError(
            f"{self.name} is carried by hand: it can be tracked, not planned for; choose a robot that moves by itself"
        )
