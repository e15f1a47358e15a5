"""What a fisheye lens does, after Kannala and Brandt ("A generic camera model and calibration method for conventional,
wide-angle, and fish-eye lenses", 2006), as OpenCV and COLMAP count it (OPENCV_FISHEYE, KANNALA_BRANDT).

A ray at the angle theta [rad] to the optical axis is shown at the radius

    theta_d = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8)

on the plane at depth 1, in its own direction around the axis.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.errors import InvalidInputError

_ROUNDS, _ASTRAY = 50, 1e-6
"""Newton's steps, and how far from the wanted radius they may end."""


def fisheye_directions(points: Float[Tensor, "*batch 2"], coefficients: tuple[float, ...]) -> Float[Tensor, "*batch 3"]:
    """Unit directions (x right, y down, z ahead) that a lens with (k1, k2, k3, k4) shows at points of the plane.

    Raises InvalidInputError where a point is shown by no ray up to half a turn, or by several: the lens folds.
    """
    wanted = points.double()
    radius = wanted.norm(dim=-1)
    theta = radius.clone()
    for _ in range(_ROUNDS):
        shown, slope = _shown(theta, coefficients)
        theta = (theta - (shown - radius) / slope.clamp_min(1e-3)).clamp(0, torch.pi)
    shown, slope = _shown(theta, coefficients)
    if not bool(((shown - radius).abs() < _ASTRAY).all() and (slope > 0).all()):  # nor is NaN
        raise InvalidInputError(
            f"the fisheye distortion {coefficients} cannot be undone up to the picture's border: calibrate again with "
            "points near the border, or use a part of the picture"
        )
    around = wanted / radius[..., None].clamp_min(1e-12)
    return torch.cat([around * theta.sin()[..., None], theta.cos()[..., None]], -1).to(points)


def fisheye_points(flat: Float[Tensor, "*batch 2"], coefficients: tuple[float, ...]) -> Float[Tensor, "*batch 2"]:
    """Where a lens with (k1, k2, k3, k4) shows points of the plane at depth 1; NaN where it folds its picture there."""
    radius = flat.double().norm(dim=-1)
    shown, slope = _shown(radius.atan(), coefficients)
    scale = torch.where(slope > 0, shown, torch.nan) / radius.clamp_min(1e-12)
    return torch.where(radius[..., None] > 1e-12, flat * scale[..., None], flat).to(flat)


def _shown(theta: Tensor, coefficients: tuple[float, ...]) -> tuple[Tensor, Tensor]:
    """theta_d and its derivative."""
    square, shown, slope = theta * theta, torch.ones_like(theta), torch.ones_like(theta)
    power = torch.ones_like(theta)
    for order, k in enumerate(coefficients, start=1):
        power = power * square
        shown, slope = shown + k * power, slope + (2 * order + 1) * k * power
    return theta * shown, slope
