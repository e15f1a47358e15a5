"""Attitude of a body that is pushed along its own z axis."""

from collections.abc import Callable

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.robots.state import RigidState

Wish = Callable[[RigidState, int], tuple[Float[Tensor, "3"], Float[Tensor, "3 3"]]]
"""Function of a state and a number of steps from now to the wanted force [N] and attitude of a controller."""
_NO_THRUST = 1e-4
"""Acceleration by thrust [m/s^2] below which it has no direction to speak of."""


def thrust_and_attitude(
    pull: Float[Tensor, "*batch 3"], yaw: Float[Tensor, "*batch"]
) -> tuple[Float[Tensor, "*batch"], Float[Tensor, "*batch 3 3"]]:
    """Compute |a| [m/s^2] and the attitude R = Tilt(a / |a|) Rz(yaw), where Tilt turns e3 the shortest way.

    Singular only upside down (Watterson and Kumar, "Control of quadrotors using the Hopf fibration on SO(3)", 2020),
    whereas the usual cross products with a heading are singular at 90 degrees of pitch.
    """
    squared = pull.square().sum(-1, keepdim=True)
    upright = torch.zeros_like(pull)
    upright[..., 2] = _NO_THRUST
    guarded = torch.where(squared > _NO_THRUST**2, pull, upright)
    thrust = guarded.square().sum(-1, keepdim=True).sqrt()
    x, y, z = (guarded / thrust).unbind(-1)
    share = 1 / (1 + z).clamp_min(1e-6)
    xx, xy, yy = 1 - x * x * share, -x * y * share, 1 - y * y * share
    cosine, sine = torch.cos(yaw), torch.sin(yaw)
    rows = [
        cosine * xx + sine * xy, cosine * xy - sine * xx, x,
        cosine * xy + sine * yy, cosine * yy - sine * xy, y,
        -cosine * x - sine * y, sine * x - cosine * y, z,
    ]  # fmt: skip
    return thrust.squeeze(-1), torch.stack(rows, -1).unflatten(-1, (3, 3))


def tipped(rotation: Float[Tensor, "3 3"], force: Float[Tensor, "3"]) -> Float[Tensor, "3 3"]:
    """Tilt an attitude to the nearest one whose z axis points along a force: no turn about that axis."""
    _, turn = thrust_and_attitude(rotation.T @ force, torch.zeros(()).to(force))
    return rotation @ turn


def upward(force: Float[Tensor, "3"], least: float) -> Float[Tensor, "3"]:
    """Raise the vertical part of a force to at least so much [N], so that the robot does not turn over."""
    return torch.cat([force[:2], force[2:].clamp_min(least)])


def shortened(vector: Float[Tensor, "3"], most: float) -> Float[Tensor, "3"]:
    """Shorten a vector to `most` at most."""
    return vector * (most / vector.norm().clamp_min(most))
