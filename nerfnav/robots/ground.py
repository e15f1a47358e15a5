"""What robots on the ground have in common: they stay level, at one height, and have a heading."""

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry import so3
from nerfnav.robots.state import RigidState

_LEVEL = 1e-3
"""Tilt [rad], height [m] and vertical speed [m/s] that count as none."""


def check_ground_ends(name: str, start: RigidState, goal: RigidState) -> None:
    """Raise InvalidInputError where a robot on the ground cannot join two states."""
    for which, state in (("start", start), ("goal", goal)):
        tilted = state.rotation[..., 2, 2] < 1 - _LEVEL
        rising = state.velocity[..., 2].abs() > _LEVEL
        rolling = state.body_rate[..., :2].abs().amax(-1) > _LEVEL
        if bool((tilted | rising | rolling).any()):
            raise InvalidInputError(f"a {name} moves on the ground: its {which} must be level and stay at its height")
    rise = (goal.position - start.position)[..., 2].abs()
    if bool((rise > _LEVEL).any()):
        raise InvalidInputError(
            f"a {name} stays at the height of its start, {start.position[..., 2].item():.3f} m: "
            f"the goal cannot be at {goal.position[..., 2].item():.3f} m"
        )


def on_the_ground(state: RigidState, before: RigidState) -> RigidState:
    """The nearest state that is level and moves in the plane, at the height of `before`."""
    return RigidState(
        spatial(state.position[..., :2], before.position[..., 2]),
        spatial(state.velocity[..., :2], 0.0),
        so3.from_yaw(heading(state)),
        about_z(state.body_rate[..., 2]),
    )


def wrapped(angle: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
    """The same angle [rad] in -pi to pi."""
    return torch.atan2(torch.sin(angle), torch.cos(angle))


def spatial(planar: Float[Tensor, "*batch 2"], third: float | Tensor) -> Float[Tensor, "*batch 3"]:
    """Vectors of the plane with a third coordinate."""
    column = torch.as_tensor(third, dtype=planar.dtype, device=planar.device).expand(planar.shape[:-1])
    return torch.cat([planar, column[..., None]], -1)


def about_z(rate: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch 3"]:
    """Body rates of a robot that only turns about z."""
    zero = torch.zeros_like(rate)
    return torch.stack([zero, zero, rate], -1)


def heading(state: RigidState) -> Float[Tensor, "*batch"]:
    """Yaw of a level state [rad]."""
    return so3.yaw_of(state.rotation)


def row(value: Tensor, batch: torch.Size) -> Tensor:
    """A number or vector as one entry of a (batch, time, ...) table."""
    return value.expand(torch.Size([*batch, *value.shape])).unsqueeze(len(batch))


def forward_speed(state: RigidState) -> Float[Tensor, "*batch"]:
    """s [m/s], negative in reverse."""
    return (state.rotation[..., 0] * state.velocity).sum(-1)
