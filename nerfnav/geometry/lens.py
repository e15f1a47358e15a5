"""Lens distortion: the Brown and the Kannala-Brandt model and their inverses, with coefficients in OpenCV's order.

Brown ("Decentering distortion of lenses", 1966). With (x, y) on the plane at depth 1, x right and y down, and
r^2 = x^2 + y^2, the lens shows

    x_d = x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2)
    y_d = y (1 + k1 r^2 + k2 r^4 + k3 r^6) + p1 (r^2 + 2 y^2) + 2 p2 x y

Kannala and Brandt ("A generic camera model and calibration method for conventional, wide-angle, and fish-eye lenses",
2006; OpenCV's and COLMAP's OPENCV_FISHEYE, KANNALA_BRANDT). A ray at the angle theta [rad] to the optical axis is
shown at the radius

    theta_d = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8)

on the plane at depth 1, in its own direction around the axis.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.core.errors import InvalidInputError

COUNTS = (0, 4, 5)
"""Allowed numbers of coefficients: none, or k1, k2, p1, p2 and perhaps k3."""
_ROUNDS, _ENOUGH = 300, 1e-9
"""Steps at most, and how near to the wanted point they end."""
_ASTRAY = 1e-4
"""Tolerance of undistorting and distorting again at depth 1, about a twentieth of a pixel."""


def distorted(points: Float[Tensor, "*batch 2"], coefficients: tuple[float, ...]) -> Float[Tensor, "*batch 2"]:
    """Distort points of the plane at depth 1 by a lens with (k1, k2, p1, p2[, k3])."""
    k1, k2, p1, p2, k3 = (*coefficients, 0.0)[:5]
    x, y = points.unbind(-1)
    square = x * x + y * y
    radial = 1 + square * (k1 + square * (k2 + square * k3))
    along_x = x * radial + 2 * p1 * x * y + p2 * (square + 2 * x * x)
    along_y = y * radial + p1 * (square + 2 * y * y) + 2 * p2 * x * y
    return torch.stack([along_x, along_y], -1)


def undistorted(points: Float[Tensor, "*batch 2"], coefficients: tuple[float, ...]) -> Float[Tensor, "*batch 2"]:
    """The points of the plane at depth 1 that such a lens shows at `points`.

    Found as the fixed point of: move by as much as the distortion still misses. Raises InvalidInputError where that
    leads nowhere, for the lens then folds its picture, and a pixel shows several points.
    """
    wanted = points.double()
    flat = wanted
    missed = torch.full_like(wanted, torch.inf)
    for _ in range(_ROUNDS):
        missed = wanted - distorted(flat, coefficients)
        flat = flat + missed
        if bool((missed.abs() < _ENOUGH).all()):
            break
    if not bool((missed.abs() < _ASTRAY).all()):  # nor is NaN
        raise InvalidInputError(
            f"the lens distortion {coefficients} cannot be undone up to the picture's border: "
            "calibrate again with points near the border, or use a part of the picture"
        )
    return flat.to(points)


_FISHEYE_ROUNDS, _FISHEYE_ASTRAY = 50, 1e-6
"""Newton's steps, and how far from the wanted radius they may end."""


def fisheye_directions(points: Float[Tensor, "*batch 2"], coefficients: tuple[float, ...]) -> Float[Tensor, "*batch 3"]:
    """Unit directions (x right, y down, z ahead) that a lens with (k1, k2, k3, k4) shows at points of the plane.

    Raises InvalidInputError where a point is shown by no ray up to half a turn, or by several: the lens folds.
    """
    wanted = points.double()
    radius = wanted.norm(dim=-1)
    theta = radius.clone()
    for _ in range(_FISHEYE_ROUNDS):
        shown, slope = _shown(theta, coefficients)
        theta = (theta - (shown - radius) / slope.clamp_min(1e-3)).clamp(0, torch.pi)
    shown, slope = _shown(theta, coefficients)
    if not bool(((shown - radius).abs() < _FISHEYE_ASTRAY).all() and (slope > 0).all()):  # nor is NaN
        raise InvalidInputError(
            f"the fisheye distortion {coefficients} cannot be undone up to the picture's border: calibrate again with "
            "points near the border, or use a part of the picture"
        )
    around = wanted / radius[..., None].clamp_min(1e-12)
    return torch.cat([around * theta.sin()[..., None], theta.cos()[..., None]], -1).to(points)


def fisheye_points(flat: Float[Tensor, "*batch 2"], coefficients: tuple[float, ...]) -> Float[Tensor, "*batch 2"]:
    """Distort points of the plane at depth 1 by a fisheye with (k1, k2, k3, k4); NaN where it folds its picture."""
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
