"""Belief: the state estimate, a Gaussian in the tangent of its mean, and its covariance after a picture (paper Eq. 7).

J is a sum of squared whitened residuals, twice the negative logarithm of the posterior density. So Laplace's
approximation at the minimum is Sigma = (H / 2)^-1, with H the exact Hessian of J in the tangent of the mean.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.core.structs import TensorStruct
from nerfnav.geometry import so3
from nerfnav.robots import ATTITUDE, POSITION, TANGENT, RigidState

POSE = [*range(TANGENT)[POSITION], *range(TANGENT)[ATTITUDE]]
"""Tangent numbers that show in a picture: position and attitude."""
ELLIPSOID_95 = 7.815
"""Square of the radius of the 95 % ellipsoid of position: chi-squared of 3 numbers."""
_LEAST_INFORMATION = 1.0
"""Least information in any direction, in units of the prediction's own: a picture takes no knowledge away."""
_SLACK = 0.05
"""Slack below that for the curvature of SO(3) and rounding."""


@dataclass(frozen=True)
class Belief(TensorStruct):
    """Gaussian state estimate: x = mean (+) d with d ~ N(0, covariance)."""

    mean: RigidState
    """Most likely state."""
    covariance: Float[Tensor, "*batch 12 12"]
    """In the tangent of the mean: position, velocity, attitude, body rate (see robots/state.py)."""

    @property
    def position_std(self) -> float:
        """Largest standard deviation of a coordinate of the position [m], of one belief."""
        return float(self.covariance.diagonal()[POSITION].max().sqrt())


class Curvature(Enum):
    """Origin of a posterior covariance; the value is the user's text."""

    EXACT = "the inverse of the exact Hessian"
    CLIPPED = "the Hessian was not convex enough: in its weak directions the prediction's covariance was kept"


def hessian(function: Callable[[Tensor], Tensor], at: Float[Tensor, " n"]) -> Float[Tensor, "n n"]:
    """Return the second derivatives of a scalar function, by differentiating its gradient row by row."""
    with torch.enable_grad():
        at = at.detach().requires_grad_()
        (gradient,) = torch.autograd.grad(function(at), at, create_graph=True)
        matrix = torch.stack([torch.autograd.grad(entry, at, retain_graph=True)[0] for entry in gradient])
    return 0.5 * (matrix + matrix.T)


def posterior_covariance(
    cost_hessian: Float[Tensor, "12 12"], prediction: Float[Tensor, "12 12"]
) -> tuple[Float[Tensor, "12 12"], Curvature]:
    """Return (H / 2)^-1, made positive definite where H is not.

    In coordinates in which the prediction's covariance is I, no eigenvalue of H / 2 may be less than 1.
    """
    root = torch.linalg.cholesky(prediction.double())
    values, vectors = torch.linalg.eigh(root.T @ (0.5 * cost_hessian.double()) @ root)
    curvature = Curvature.EXACT if values.min() >= _LEAST_INFORMATION - _SLACK else Curvature.CLIPPED
    if curvature is Curvature.CLIPPED:
        values = values.clamp_min(_LEAST_INFORMATION)
    half = root @ (vectors / values.sqrt())
    return (half @ half.T).to(prediction), curvature


def add_information(
    turn: Float[Tensor, "3"], predicted: Float[Tensor, "12 12"], seen: Float[Tensor, "6 6"]
) -> Float[Tensor, "12 12"]:
    """Return the information in the tangent of the mean: that of the prediction, in its tangent, plus that of the pose.

    `turn` is the mean's attitude in the tangent of the prediction's.
    """
    derivative = torch.eye(TANGENT)
    derivative[ATTITUDE, ATTITUDE] = torch.linalg.inv(so3.right_jacobian(turn))
    information = derivative.T @ predicted @ derivative
    place = torch.eye(TANGENT)[POSE]
    return information + place.T @ seen @ place
