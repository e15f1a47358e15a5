"""Strapdown mechanisation: integrate gyroscopes and accelerometers into a state, without a model of forces.

    R' = R hat(w),   v' = R a + g,   p' = v

with the gyroscopes' w and the accelerometers' a (specific force), both in the body's axes. Over an interval they come
to increments that do not depend on the state at its beginning (preintegration: Forster et al., "On-manifold
preintegration for real-time visual-inertial odometry", 2017),

    R+ = R D,   v+ = v + g t + R dv,   p+ = p + v t + 1/2 g t^2 + R dp
"""

from typing import NamedTuple, TypeVar

import numpy as np
from jaxtyping import Float
from torch import Tensor

from nerfnav.robots import RigidState

_Array = TypeVar("_Array", np.ndarray, Tensor)


class Increments(NamedTuple):
    """Measurements over an interval, in the body's axes at its beginning."""

    turn: Float[Tensor, "*batch 3 3"]
    """D."""
    speed: Float[Tensor, "*batch 3"]
    """dv [m/s]."""
    way: Float[Tensor, "*batch 3"]
    """dp [m]."""
    rate: Float[Tensor, "*batch 3"]
    """The last angular velocity [rad/s]."""


def propagate_state(state: RigidState, measured: Increments, gravity: Float[Tensor, "3"], time: float) -> RigidState:
    """Return the state after a time [s]; `gravity` is g, downwards [m/s^2]."""

    def turned(vector: Tensor) -> Tensor:
        return (state.rotation @ vector[..., None])[..., 0]

    return RigidState(
        state.position + (state.velocity + 0.5 * time * gravity) * time + turned(measured.way),
        state.velocity + gravity * time + turned(measured.speed),
        state.rotation @ measured.turn,
        measured.rate,
    )


def integrate_step(
    at: tuple[_Array, _Array, _Array], turns: tuple[_Array, _Array], force: _Array, gravity: _Array, dt: float
) -> tuple[_Array, _Array, _Array]:
    """Return R, v and p after a short time [s]; `turns` are those in half of it, and in all (midpoint rule).

    `force` is specific [m/s^2]. Arrays and tensors are taken alike.
    """
    (rotation, velocity, position), (half, whole) = at, turns
    acceleration = rotation @ half @ force + gravity
    return rotation @ whole, velocity + dt * acceleration, position + (velocity + 0.5 * dt * acceleration) * dt
