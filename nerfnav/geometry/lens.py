"""What a real lens does to straight lines, after Brown ("Decentering distortion of lenses", 1966), as OpenCV counts it.

With (x, y) on the plane at depth 1, x right and y down, and r^2 = x^2 + y^2, the lens shows

    x_d = x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2)
    y_d = y (1 + k1 r^2 + k2 r^4 + k3 r^6) + p1 (r^2 + 2 y^2) + 2 p2 x y
"""

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.core.errors import InvalidInputError

COUNTS = (0, 4, 5)
"""How many coefficients there may be: none, or k1, k2, p1, p2 and perhaps k3."""
_ROUNDS, _ENOUGH = 300, 1e-9
"""Steps at most, and how near to the wanted point they end."""
_ASTRAY = 1e-4
"""How far undistorting and distorting again may lead from a point at depth 1, about a twentieth of a pixel."""


def distorted(points: Float[Tensor, "*batch 2"], coefficients: tuple[float, ...]) -> Float[Tensor, "*batch 2"]:
    """Where a lens with (k1, k2, p1, p2[, k3]) shows points of the plane at depth 1."""
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
