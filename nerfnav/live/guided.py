"""A vehicle that follows setpoints, as its tracker predicts it: constant velocities, and what the setpoints change.

Notation as in robots/state.py. Over a step dt, with the action u = (dp, dv, dtheta, dw):

    p' = p + v dt + dp,   v' = v + dv,   R' = R Exp(w dt) Exp(dtheta),   w' = w + dw

`change` is the action of a vehicle that follows guidance: by how much that differs from constant velocities. A vehicle
that flies stands as its acceleration wants it: its z axis along a - g (Mellinger and Kumar, 2011). What the vehicle
does besides is process noise.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.geometry import so3
from nerfnav.live.answer import Guidance, Order, Setpoint
from nerfnav.robots import TANGENT, HandHeld, RigidState, thrust_and_attitude

_GRAVITY = 9.81
_INSTANT_S = 0.01
"""Over which body rates are taken."""


class Guided(HandHeld):
    """What is guided."""

    action_names = tuple(f"{part}_{axis}" for part in ("dp", "dv", "dtheta", "dw") for axis in "xyz")
    action_weights = (1.0,) * TANGENT

    def step(self, state: RigidState, action: Float[Tensor, "*batch 12"], dt: float) -> RigidState:
        """The state after `dt` [s]."""
        return super().step(state, action[..., :0], dt).retract(action)

    def hold(self, state: RigidState, dt: float, turn: float = 0.0) -> Float[Tensor, "12"]:
        """Move on."""
        return torch.zeros(TANGENT)


def change(guidance: Guidance | None, start: float, end: float, flies: bool) -> Float[Tensor, "12"] | None:
    """The action of a vehicle that follows guidance from one time [s] to another; None where it follows none."""
    before, after = (expected(guidance, time, flies) for time in (start, end))
    if before is None or after is None:
        return None
    return HandHeld().step(before, torch.zeros(0), end - start).local(after)


def expected(guidance: Guidance | None, time: float, flies: bool) -> RigidState | None:
    """The state at a time [s] of a vehicle that follows guidance; None where there is none to follow."""
    if guidance is None or guidance.order not in (Order.FOLLOW, Order.BRAKE):
        return None
    point, later = guidance.at(time), guidance.at(time + _INSTANT_S)
    assert point is not None and later is not None, "what is to be followed has setpoints"
    here, there = _attitude(point, flies), _attitude(later, flies)
    rate = so3.local(here, there) / _INSTANT_S
    return RigidState(torch.tensor(point.position), torch.tensor(point.velocity), here, rate)


def _attitude(point: Setpoint, flies: bool) -> Float[Tensor, "3 3"]:
    yaw = torch.tensor(point.yaw)
    if not flies:
        return so3.from_yaw(yaw)
    pull = torch.tensor(point.acceleration) + torch.tensor([0.0, 0.0, _GRAVITY])
    return thrust_and_attitude(pull[None], yaw[None])[1][0]
