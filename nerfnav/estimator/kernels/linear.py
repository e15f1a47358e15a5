"""Small dense linear algebra: without a library whose threads would wait for each other."""

import math

from nerfnav.compiled import kernel


@kernel()
def solve_positive(matrix, right, out):
    """out = matrix^-1 right by Cholesky's method; `matrix` (k, k), positive definite, is used up.

    Returns whether it was positive definite; where not, `out` holds nothing of use.
    """
    count = matrix.shape[0]
    for i in range(count):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= matrix[i, k] * matrix[j, k]
            if i > j:
                matrix[i, j] = total / matrix[j, j]
            elif total > 0.0:
                matrix[i, i] = math.sqrt(total)
            else:
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
