"""Smoothing splines of seventh order: least squares of values and derivatives plus the integral of the squared snap.

A quadratic program with equality constraints, solved by its KKT system (Mellinger and Kumar, ICRA 2011): value,
velocity, acceleration and jerk are continuous where pieces meet, and what is given of the ends is met exactly.
"""

from dataclasses import dataclass

import numpy as np
import scipy
import torch

from nerfnav.planner import PiecewisePolynomial, derivative_rows, squared_derivative

ORDER = 7
_TERMS = ORDER + 1
_SMOOTHNESS = 4  # derivatives 0 to 3 are continuous


@dataclass(frozen=True)
class Samples:
    """Samples that a spline approximates."""

    times: np.ndarray
    """(n,), from 0 [s]."""
    known: tuple[np.ndarray, ...]
    """Values, and as far as they are known their derivatives, each (n, axes)."""
    scales: tuple[float, ...]
    """For each of `known`: the difference that counts as 1."""
    ends: tuple[np.ndarray, ...]
    """Value and derivatives of the first and the last time, each (2, axes), which are met exactly."""


def fit(samples: Samples, count: int, smoothing: float) -> PiecewisePolynomial:
    """`count` pieces of equal length; `smoothing` weighs the integral of the squared fourth derivative [s^7]."""
    length = float(samples.times[-1]) / count
    piece = np.clip((samples.times / length).astype(int), 0, count - 1)
    u = samples.times / length - piece  # each piece runs from 0 to 1: that keeps the powers alike
    snap = squared_derivative(4, _TERMS).numpy() * (smoothing / length**7)
    hessian, right = scipy.sparse.kron(scipy.sparse.eye(count), snap), 0.0
    for order, (values, scale) in enumerate(zip(samples.known, samples.scales, strict=True)):
        rows = _rows(u, piece, count, order) / (length**order * scale)
        hessian, right = hessian + rows.T @ rows, right + rows.T @ (values / scale)
    edges, at = np.array([0.0, 1.0]), np.array([0, count - 1])
    first, second = np.arange(count - 1), np.arange(1, count)
    joints = [
        _rows(np.ones(count - 1), first, count, d) - _rows(np.zeros(count - 1), second, count, d)
        for d in range(_SMOOTHNESS)
    ]
    ends = [_rows(edges, at, count, order) for order in range(len(samples.ends))]
    held = scipy.sparse.vstack([*ends, *joints])
    given = [length**order * values for order, values in enumerate(samples.ends)]
    zeros = np.zeros((held.shape[0] - 2 * len(given), samples.known[0].shape[1]))
    kkt = scipy.sparse.bmat([[hessian, held.T], [held, None]], format="csc")
    solved = scipy.sparse.linalg.splu(kkt).solve(np.concatenate([right, *given, zeros]))
    coefficients = solved[: count * _TERMS].reshape(count, _TERMS, -1)
    return PiecewisePolynomial(length * torch.arange(count + 1, dtype=torch.float64), torch.from_numpy(coefficients))


def _rows(u: np.ndarray, piece: np.ndarray, count: int, order: int) -> "scipy.sparse.csr_array":
    """Design matrix: share of each coefficient of all pieces in a derivative at u of a piece: (n, 8 count)."""
    powers = derivative_rows(torch.from_numpy(u), order, _TERMS).numpy()
    columns = piece[:, None] * _TERMS + np.arange(_TERMS)
    rows = np.repeat(np.arange(len(u)), _TERMS)
    return scipy.sparse.csr_array((powers.reshape(-1), (rows, columns.reshape(-1))), shape=(len(u), count * _TERMS))
