"""BFGS with a preconditioner: few, cheap iterations on a cost that is nearly all control effort at first.

    x+ = x - t B g,   B the inverse Hessian: begun with the control cost's own curvature, then updated by BFGS

(Nocedal and Wright, "Numerical Optimization", 2006, Eqs. 6.17 and 18.23: damped, since the density has kinks.)
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import scipy

from nerfnav.planner.kernels.bfgs import inverse_of_absolute, inverse_of_shifted, newton_steps, rank_two
from nerfnav.planner.objective.objective import Evaluation, FusedObjective, Objective
from nerfnav.planner.steps import PlanCost

_ARMIJO, _TRIES = 1e-4, 12
"""Backtracking (Nocedal and Wright, Alg. 3.1): share of the slope by which J must fall, and largest number of tries."""
_LOW, _HIGH = 0.1, 0.5
"""Least and largest factor between two tries of a step."""
_DAMPING = 0.2
"""Least share of the curvature that is expected along a step."""
_AT_ONCE = 10
"""Steps of a search that are made in one call: they count from its start, so that none is made for nothing where a
search is left after a multiple of it."""
_DIFFERENCE = 1e-4
"""Step of the differences that curvature is taken from, in scales."""
_LARGE = 128
"""Free numbers up to which our own kernels take some milliseconds, and round alike on all processors. With 352,
rotations take 190 ms and LAPACK 8; Cholesky's method 10 and 4."""
_STIFFER, _LOOSER = 10.0, 10.0
"""Factors on the prior and the tolerance of a search that starts nearly at a minimum."""


@dataclass(frozen=True)
class NewtonConfig:
    """Settings of the minimisation of J."""

    iterations: int = 1000
    """Largest number of steps; a path of 150 time steps along furniture has taken more than 400."""
    stretch: int = 300
    """Number of steps after which the estimated curvature is dropped, and the search begins again with the control
    cost's curvature at its point: on long paths an old estimate leads into ever shorter steps, for J has kinks."""
    prior: float = 1.0
    """Curvature that is added for what the control cost does not see, in units of J for a change by one scale."""
    reach: float = 1.0
    """Longest step of any free number, in its scale."""
    tolerance: float = 1e-4
    """Share of J by which the last `patience` iterations must have improved it, or the search ends."""
    patience: int = 8
    """Number of iterations to which `tolerance` applies."""
    least: float = 0.01
    """Value of J below which shares are taken of this instead [1]: to stand still costs nothing."""

    def nearby(self) -> "NewtonConfig":
        """Return the settings for a start that is nearly a minimum: shorter first steps, which stay near it, and
        earlier ends."""
        return replace(self, prior=_STIFFER * self.prior, tolerance=_LOOSER * self.tolerance)


@dataclass(frozen=True)
class Iterate:
    """One point of a search."""

    point: Evaluation
    """J at this point."""
    settled: bool
    """True if J has settled there."""


def minimise(
    objective: Objective,
    now: Evaluation,
    scales: np.ndarray,
    config: NewtonConfig,
    inverse: np.ndarray | None = None,
) -> Iterator[Iterate]:
    """Yield every iterate of the search, the start `now` first, J falling from one to the next.

    `scales` (k) are the changes of the free numbers that change the motion much. `inverse` (k, k),
    the first inverse Hessian, is the preconditioner at the start where none is given.
    """
    here, made = Iterate(now, False), 0
    yield here
    while made < config.iterations and not here.settled:
        if inverse is None:
            inverse = preconditioner(objective.effort_curvature, here.point.free, scales, config.prior)
        stretch = replace(config, iterations=min(config.stretch, config.iterations - made))
        following = _descend(objective, here.point, inverse, config.reach * scales, stretch)
        for here in following:
            made += 1
            yield here
        inverse = None


def _descend(
    objective: Objective, now: Evaluation, inverse: np.ndarray, reach: np.ndarray, config: NewtonConfig
) -> Iterator[Iterate]:
    """Yield the iterates after `now`, from one inverse Hessian on."""
    if objective.fused is not None:
        yield from _descend_compiled(objective.fused, now, inverse, reach, config)
        return
    first, history, fresh = inverse, [now.cost.total], True
    for _ in range(config.iterations):
        moved = _advance(objective, now, inverse, reach)
        if moved is None:
            if fresh:
                yield Iterate(now, True)
                return
            inverse, fresh = first, True  # the estimated curvature misleads: drop it
            continue
        (now, inverse), fresh = moved, False
        history.append(now.cost.total)
        settled = len(history) > config.patience and (
            history[-1 - config.patience] - history[-1] <= config.tolerance * max(abs(history[-1]), config.least)
        )
        yield Iterate(now, settled)
        if settled:
            return


def _descend_compiled(
    fused: FusedObjective, start: Evaluation, inverse: np.ndarray, reach: np.ndarray, config: NewtonConfig
) -> Iterator[Iterate]:
    """Do the same for a fused objective: a few steps are made in one call, before the first of them is yielded."""
    count, cost = len(start.free), start.cost
    trace = tuple(np.empty((config.iterations + 1, width)) for width in (count, count, 6))
    trace[0][0], trace[1][0] = start.free, start.gradient
    trace[2][0] = cost.collision, cost.control, cost.limits, cost.risk, cost.movers, cost.delay
    rule = (_ARMIJO, _LOW, _HIGH, _TRIES), _DAMPING, config.patience, config.tolerance, config.least
    inverses, at, settled, fresh = (inverse.copy(), inverse), 0, False, True
    while at < config.iterations and not settled:
        before, until = at, min((at + 1) // _AT_ONCE * _AT_ONCE + _AT_ONCE - 1, config.iterations)
        at, settled, fresh = newton_steps(trace, at, until, fresh, inverses, reach, fused.parts, rule)
        made = slice(min(before + 1, at), at + 1)  # the last one again where J does not fall at all
        rows = zip(range(made.start, at + 1), trace[0][made], trace[1][made], trace[2][made].tolist(), strict=True)
        for step, free, gradient, terms in rows:
            yield Iterate(Evaluation(free, PlanCost(*terms), gradient), settled and step == at)


def preconditioner(
    curvature: Callable[[np.ndarray, np.ndarray], np.ndarray], free: np.ndarray, scales: np.ndarray, prior: float
) -> np.ndarray:
    """Invert |H| + prior / scales^2, with H = curvature(free, steps) by differences over small steps.

    Where no eigenvalue is below half of -prior, that of H + prior / scales^2: in a tenth of the time, and as good.
    """
    scaled = curvature(free, _DIFFERENCE * scales) * np.outer(scales, scales)
    symmetric, inverse = 0.5 * (scaled + scaled.T), np.empty_like(scaled)
    if len(free) > _LARGE:
        inverse = _invert_with_lapack(symmetric, prior)
    elif not inverse_of_shifted(symmetric, prior, inverse):
        inverse = inverse_of_absolute(symmetric, prior)
    return np.outer(scales, scales) * inverse


def _invert_with_lapack(matrix: np.ndarray, prior: float) -> np.ndarray:
    """Compute (A + prior I)^-1 of a symmetric matrix A (k, k); (|A| + prior I)^-1 with eigenvalues below -prior / 2."""
    lapack, unit = scipy.linalg.lapack, np.eye(len(matrix))
    if lapack.dpotrf(matrix + 0.5 * prior * unit, lower=True, overwrite_a=True)[1] == 0:
        root, _ = lapack.dpotrf(matrix + prior * unit, lower=True, overwrite_a=True)
        lower, _ = lapack.dpotri(root, lower=True, overwrite_c=True)  # above its diagonal are zeros
        inverse = lower + lower.T
        np.fill_diagonal(inverse, lower.diagonal())
        return inverse
    return _inverse_by_eigenvectors(matrix, prior)


def _inverse_by_eigenvectors(matrix: np.ndarray, prior: float) -> np.ndarray:
    """Compute (|A| + prior I)^-1 of a symmetric matrix A (k, k), prior > 0, with LAPACK."""
    values, vectors = np.linalg.eigh(matrix)
    return vectors / (np.abs(values) + prior) @ vectors.T


def _advance(
    objective: Objective, now: Evaluation, inverse: np.ndarray, reach: np.ndarray
) -> tuple[Evaluation, np.ndarray] | None:
    """Take a step; return the next point and its inverse Hessian, or None where J does not fall along the direction."""
    direction = -(inverse @ now.gradient)
    slope = float(direction @ now.gradient)
    following = _search(objective, now, direction, slope, reach) if slope < 0 else None
    if following is None:
        return None
    step = following.free - now.free
    # the step goes along -B g, so that B^-1 step is a multiple of g and needs no solving
    pulled = float(step @ direction / (direction @ direction)) * -now.gradient
    return following, bfgs(inverse, step, pulled, following.gradient - now.gradient)


def bfgs(inverse: np.ndarray, step: np.ndarray, pulled: np.ndarray, change: np.ndarray) -> np.ndarray:
    """Update the inverse Hessian by a step and the change of the gradient along it, damped to stay positive definite.

    `pulled` is the change that the inverse so far, B, would explain: B^-1 step.
    """
    expected, seen = float(step @ pulled), float(step @ change)
    if seen < _DAMPING * expected:
        share = (1 - _DAMPING) * expected / (expected - seen)
        change = share * change + (1 - share) * pulled
        seen = float(step @ change)
    along = inverse @ change
    inverse = inverse.copy()
    rank_two(inverse, step, along, (1 + change @ along / seen) / seen, 1 / seen)
    return inverse


def _search(
    objective: Objective, now: Evaluation, direction: np.ndarray, slope: float, reach: np.ndarray
) -> Evaluation | None:
    """Find the first point along `direction`, at most `reach` away, where J fell enough (Armijo); None if there is
    none.
    """
    length = min(1.0, float(1 / np.max(np.abs(direction) / reach)))
    for _ in range(_TRIES):
        tried = objective(now.free + length * direction)
        gain = tried.cost.total - now.cost.total
        if gain <= _ARMIJO * length * slope:
            return tried
        # the minimum of the parabola through these values; NaN shrinks as far as allowed
        best = -0.5 * slope * length**2 / (gain - slope * length)
        length *= float(np.clip(best / length, _LOW, _HIGH)) if np.isfinite(best) else _HIGH
    return None
