"""BFGS on a quadrotor's J: several steps of the search in one call, with the inverse Hessians that they begin from.

The same as solvers/bfgs.py, whose notation holds here, on kernels/quadrotor.py; tests hold both equal. `parts` is
what `evaluate` asks for: task, body, space and weights.

The inverse of a symmetric matrix's absolute value is found by one-sided Jacobi rotations (Hestenes, 1958), or by
Cholesky. Rotations V make the rows of V A orthogonal: V A = S U with S diagonal, so that |A| = (A A)^1/2 = V' S V. They
round alike on all processors, which a library's eigenvectors do not, and take too long for large matrices.
"""

import math

import numpy as np

from nerfnav.core.jit import kernel
from nerfnav.geometry.linear import copy_matrix, root_of
from nerfnav.planner.kernels.quadrotor import effort_at, gradient_at, room_for, surroundings_at


@kernel()
def rank_two(inverse, step, along, straight, mixed):
    """inverse += straight * step step' - mixed * (along step' + step along'), (k, k)."""
    count = step.shape[0]
    for i in range(count):
        own, other = straight * step[i] - mixed * along[i], mixed * step[i]
        for j in range(count):
            inverse[i, j] += own * step[j] - other * along[j]


SWEEPS = 30
EXACT = 1e-11
"""Cosine of the angle between two rows below which they count as orthogonal."""


@kernel()
def inverse_of_absolute(matrix, prior):
    """(|A| + prior I)^-1 of a symmetric matrix A (k, k), prior > 0."""
    count = matrix.shape[0]
    rows, turns = matrix.copy(), np.eye(count)
    for _ in range(SWEEPS):
        worst = 0.0
        for p in range(count - 1):
            for q in range(p + 1, count):
                first, second, both = 0.0, 0.0, 0.0
                for i in range(count):
                    first += rows[p, i] * rows[p, i]
                    second += rows[q, i] * rows[q, i]
                    both += rows[p, i] * rows[q, i]
                size = math.sqrt(first * second)
                if abs(both) <= EXACT * size or size < 1e-300:
                    continue
                worst = max(worst, abs(both) / size)
                half = (second - first) / (2.0 * both)
                tangent = (1.0 if half >= 0.0 else -1.0) / (abs(half) + math.sqrt(1.0 + half * half))
                cosine = 1.0 / math.sqrt(1.0 + tangent * tangent)
                sine = cosine * tangent
                for i in range(count):
                    a, b = rows[p, i], rows[q, i]
                    rows[p, i], rows[q, i] = cosine * a - sine * b, sine * a + cosine * b
                    a, b = turns[p, i], turns[q, i]
                    turns[p, i], turns[q, i] = cosine * a - sine * b, sine * a + cosine * b
        if worst <= EXACT:
            break
    result = np.zeros((count, count))
    for p in range(count):
        squared = 0.0
        for i in range(count):
            squared += rows[p, i] * rows[p, i]
        share = 1.0 / (math.sqrt(squared) + prior)
        for i in range(count):
            for j in range(count):
                result[i, j] += share * turns[p, i] * turns[p, j]
    return result


@kernel()
def inverse_of_shifted(matrix, prior, out):
    """Fill `out` with (A + prior I)^-1 of a symmetric matrix A (k, k), by Cholesky's method.

    Returns whether A + prior / 2 I is positive definite; where not, `out` holds nothing of use.
    """
    root = np.empty_like(matrix)
    if not (root_of(matrix, 0.5 * prior, root) and root_of(matrix, prior, root)):
        return False
    count = matrix.shape[0]
    inverse = np.zeros((count, count))  # of the root, its columns as rows
    for j in range(count):
        inverse[j, j] = 1.0 / root[j, j]
        for i in range(j + 1, count):
            total = 0.0
            for k in range(j, i):
                total -= root[i, k] * inverse[j, k]
            inverse[j, i] = total / root[i, i]
    for i in range(count):
        for j in range(i, count):
            total = 0.0
            for k in range(j, count):
                total += inverse[i, k] * inverse[j, k]
            out[i, j] = out[j, i] = total
    return True


@kernel()
def newton_steps(trace, at, until, fresh, inverses, reach, parts, rule):
    """Go on from step `at` of a search up to step `until`, or to where J has settled.

    `trace` is (points (n, k), gradients (n, k), terms of J (n, 6)); `inverses` the inverse Hessian (k, k), which is
    updated in place, and the one that the search began with; `fresh` says whether they are equal. `rule` is (that of
    `_search_along`, damping, patience, tolerance, least), see NewtonConfig. Returns the last step, whether J has
    settled there, and `fresh`.
    """
    inverse, first = inverses
    searching, damping, patience, tolerance, least = rule
    scratch, room = np.empty((4, reach.shape[0])), room_for(reach.shape[0])
    while at < until:
        if not _step(trace, at, inverse, reach, parts, searching, damping, scratch, room):
            if fresh:
                return at, True, fresh
            copy_matrix(first, inverse)  # the estimated curvature misleads: drop it
            fresh = True
            continue
        at, fresh = at + 1, False
        now = _total(trace[2], at)
        if at >= patience and _total(trace[2], at - patience) - now <= tolerance * max(abs(now), least):
            return at, True, fresh
    return at, False, fresh


@kernel()
def _total(terms, at):
    """J at a step."""
    return terms[at, 0] + terms[at, 1] + terms[at, 2] + terms[at, 3] + terms[at, 4] + terms[at, 5]


@kernel()
def _step(trace, at, inverse, reach, parts, searching, damping, scratch, room):
    """One step of BFGS: fill the next row of the trace, update the inverse Hessian; False where J does not fall."""
    free, gradient = trace[0][at], trace[1][at]
    direction, step, change, along = scratch
    slope, longest = 0.0, 0.0
    for i in range(free.shape[0]):
        down = 0.0
        for j in range(free.shape[0]):
            down -= inverse[i, j] * gradient[j]
        direction[i] = down
        slope += down * gradient[i]
        longest = max(longest, abs(down) / reach[i])
    if not slope < 0.0:
        return False
    lengths = (_total(trace[2], at), slope, min(1.0, 1.0 / longest))
    if not _search_along(trace, at, direction, lengths, parts, searching, room):
        return False
    squared, length = 0.0, 0.0
    for i in range(free.shape[0]):
        step[i], change[i] = trace[0][at + 1, i] - free[i], trace[1][at + 1, i] - gradient[i]
        squared += direction[i] * direction[i]
        length += step[i] * direction[i]
    length /= squared
    expected, seen = 0.0, 0.0
    for i in range(free.shape[0]):
        expected -= step[i] * length * gradient[i]
        seen += step[i] * change[i]
    if seen < damping * expected:
        share = (1.0 - damping) * expected / (expected - seen)
        seen = 0.0
        for i in range(free.shape[0]):
            change[i] = share * change[i] - (1.0 - share) * length * gradient[i]
            seen += step[i] * change[i]
    twice = 0.0
    for i in range(free.shape[0]):
        along[i] = 0.0
        for j in range(free.shape[0]):
            along[i] += inverse[i, j] * change[j]
        twice += change[i] * along[i]
    rank_two(inverse, step, along, (1.0 + twice / seen) / seen, 1.0 / seen)
    return True


@kernel()
def _search_along(trace, at, direction, lengths, parts, rule, room):
    """Backtracking on Armijo's rule; fills the next row of the trace with where it ends, and says whether J fell.

    `lengths` is (J, slope, first length), `rule` (share of the slope, least and largest factor between two tries,
    tries). The field is not evaluated where effort alone, of J's parts none of which is below 0, says that the least
    factor comes next; the gradient is made of the point that is taken.
    """
    task, body, space, weights = parts
    total, slope, length = lengths
    armijo, low, high, most = rule
    free, tried, gradient, terms = trace[0][at], trace[0][at + 1], trace[1][at + 1], trace[2][at + 1]
    for _ in range(most):
        for i in range(free.shape[0]):
            tried[i] = free[i] + length * direction[i]
        terms[1], terms[2], terms[5] = effort_at(tried, task, body, space, weights, room)
        if _share(terms[1] + terms[2] + terms[5] - total, slope, length) <= low:
            length *= low
            continue
        terms[0], terms[3], terms[4] = surroundings_at(body, space, weights, room)
        gain = terms[0] + terms[1] + terms[2] + terms[3] + terms[4] + terms[5] - total
        if gain <= armijo * length * slope:
            gradient_at(tried, task, room, gradient)
            return True
        share = _share(gain, slope, length)
        length *= min(max(share, low), high) if math.isfinite(share) else high
    return False


@kernel()
def _share(gain, slope, length):
    """Find the minimum of the parabola through J, its slope and its gain at a length, as a share of the length; the
    larger the gain, the smaller."""
    if gain <= slope * length:
        return math.inf
    return -0.5 * slope * length / (gain - slope * length)
