"""The inverse of a symmetric matrix's absolute value by one-sided Jacobi rotations (Hestenes, 1958), or by Cholesky.

Rotations V make the rows of V A orthogonal: V A = S U with S diagonal, so that |A| = (A A)^1/2 = V' S V. A library's
eigenvectors would come from a pool of threads that wait for each other.
"""

import math

import numpy as np

from nerfnav.compiled import kernel
from nerfnav.geometry.kernels.linear import root_of

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
