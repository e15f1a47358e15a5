"""Piecewise polynomials in time, with the rows of linear systems that constrain them.

Notation: segment i spans [t_i, t_{i+1}] of length T_i, u = (t - t_i) / T_i in [0, 1], and on it

    p(t) = sum_k c_{i,k} u^k,    d^n p / dt^n = T_i^-n sum_k k (k-1) .. (k-n+1) c_{i,k} u^(k-n)
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor


@dataclass(frozen=True)
class PiecewisePolynomial:
    """Polynomials on neighbouring spans of time."""

    times: Float[Tensor, " knots"]
    """Times at which the segments begin and end [s], rising."""
    coefficients: Float[Tensor, "segments terms axes"]
    """c_{i,k} for each axis, float64."""

    def __call__(self, time: Float[Tensor, " n"], order: int = 0) -> Float[Tensor, "n axes"]:
        """Evaluate the derivative of that order at times [s]; beyond the ends the first and last polynomial go on."""
        time = time.double()
        segment = (torch.searchsorted(self.times, time, right=True) - 1).clamp(0, len(self.coefficients) - 1)
        spans = self.times.diff()[segment]
        rows = derivative_rows((time - self.times[segment]) / spans, order, self.coefficients.shape[1])
        return torch.einsum("nk,nka->na", rows / spans[:, None] ** order, self.coefficients[segment])


def uniform_cubic(points: Float[Tensor, "n axes"], step: float) -> PiecewisePolynomial:
    """Make the uniform cubic B-spline with at least four control points (float64), `step` [s] apart.

    Its time 0 is that of the second one, and it ends at that of the last but one; at control point k between them it is

        p = (c_k-1 + 4 c_k + c_k+1) / 6,   p' = (c_k+1 - c_k-1) / (2 step),   p'' = (c_k-1 - 2 c_k + c_k+1) / step^2
    """
    c0, c1, c2, c3 = (points[first : len(points) - 3 + first] for first in range(4))
    coefficients = [(c0 + 4 * c1 + c2) / 6, (c2 - c0) / 2, (c0 - 2 * c1 + c2) / 2, (3 * (c1 - c2) + c3 - c0) / 6]
    knots = step * torch.arange(len(c0) + 1, dtype=torch.float64)
    return PiecewisePolynomial(knots, torch.stack(coefficients, 1))


def derivative_rows(u: Float[Tensor, " n"], order: int, terms: int) -> Float[Tensor, "n {terms}"]:
    """Compute the share of each coefficient in the derivative d^order / du^order at u."""
    power = torch.arange(terms, dtype=torch.float64)
    factor = torch.ones(terms, dtype=torch.float64)
    for step in range(order):
        factor = factor * (power - step).clamp_min(0)
    return factor * u.double()[:, None] ** (power - order).clamp_min(0)


def squared_derivative(order: int, terms: int) -> Float[Tensor, "{terms} {terms}"]:
    """Compute the matrix Q with c' Q c = integral over u of (d^order p / du^order)^2."""
    power = torch.arange(terms, dtype=torch.float64)
    factor = derivative_rows(torch.ones(1), order, terms)[0]
    exponent = (power[:, None] + power - 2 * order + 1).clamp_min(1)
    return factor[:, None] * factor / exponent
