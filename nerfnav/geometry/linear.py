"""Small dense linear algebra: without a library whose threads would wait for each other."""

import math

from nerfnav.core.jit import kernel


@kernel()
def copy_matrix(source, out):
    """out = source (m, n), of equal shapes. numba's `out[:] = source` adds seconds of compilation for its message."""
    for i in range(source.shape[0]):
        for j in range(source.shape[1]):
            out[i, j] = source[i, j]


@kernel()
def root_of(matrix, shift, root):
    """Fill the lower triangle of Cholesky's root of A + shift I; returns whether that is positive definite.

    `matrix` A (k, k) is symmetric, and only its lower triangle is read; `root` may be `matrix` itself.
    """
    for i in range(matrix.shape[0]):
        for j in range(i + 1):
            total = matrix[i, j] + (shift if i == j else 0.0)
            for k in range(j):
                total -= root[i, k] * root[j, k]
            if i > j:
                root[i, j] = total / root[j, j]
            elif total > 0.0:
                root[i, i] = math.sqrt(total)
            else:
                return False
    return True


@kernel()
def solve_positive(matrix, right, out):
    """out = matrix^-1 right by Cholesky's method; `matrix` (k, k), positive definite, is used up.

    Returns whether it was positive definite; where not, `out` holds nothing of use.
    """
    count = matrix.shape[0]
    if not root_of(matrix, 0.0, matrix):
        return False
    for i in range(count):
        total = right[i]
        for k in range(i):
            total -= matrix[i, k] * out[k]
        out[i] = total / matrix[i, i]
    for i in range(count - 1, -1, -1):
        total = out[i]
        for k in range(i + 1, count):
            total -= matrix[k, i] * out[k]
        out[i] = total / matrix[i, i]
    return True


@kernel()
def multiply(first, second, out):
    """out = first @ second, of any sizes."""
    for i in range(first.shape[0]):
        for j in range(second.shape[1]):
            total = 0.0
            for k in range(first.shape[1]):
                total += first[i, k] * second[k, j]
            out[i, j] = total
