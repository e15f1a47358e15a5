"""Handheld camera: constant velocities but for the motion of the hand, which is not measured.

Notation as in robots/state.py. Constant-velocity model over a step dt, without any action:

    p' = p + v dt,   v' = v,   R' = R Exp(w dt),   w' = w

The motion of the hand is process noise (`RandomAcceleration`, see noise.py).
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
    """Handheld camera: tracked, and never planned for."""

    action_names = ()
    action_weights = ()
    minimum_steps = 1

    def __init__(self, name: str = "handheld", body: Body | None = None) -> None:
        """Make a camera in a hand (default: of 10 cm)."""
        self.name = name
        self.body = Body.box(_EXTENTS, (3, 3, 3)) if body is None else body

    def require_planned(self) -> None:
        """Raise InvalidInputError: a hand is not planned for."""
        raise self._never()

    def step(self, state: RigidState, action: Float[Tensor, "*batch 0"], dt: float) -> RigidState:
        """Move a state on for `dt` [s]."""
        return RigidState(
            state.position + state.velocity * dt,
            state.velocity,
            so3.retract(state.rotation, state.body_rate * dt),
            state.body_rate,
        )

    def hold(self, state: RigidState, dt: float, turn: float = 0.0) -> Float[Tensor, " 0"]:
        """Return an empty action: a hand takes no commands."""
        return torch.zeros(0)

    def motion(
        self, free: Float[Tensor, "*batch k"], start: RigidState, goal: RigidState, steps: int, dt: float
    ) -> Motion:
        """Raise InvalidInputError: a hand is not planned for."""
        raise self._never()

    def encode(
        self, waypoints: Float[Tensor, "times 4"], start: RigidState, goal: RigidState, dt: float
    ) -> Float[Tensor, " k"]:
        """Raise InvalidInputError: a hand is not planned for."""
        raise self._never()

    def check_ends(self, start: RigidState, goal: RigidState) -> None:
        """Raise InvalidInputError: a hand is not planned for, and planners check this first."""
        raise self._never()

    def _never(self) -> InvalidInputError:
        return InvalidInputError(
            f"{self.name} is carried by hand: it can be tracked, not planned for; choose a robot that moves by itself"
        )
