"""Small dense linear algebra: without a library whose threads would wait for each other."""

import math

import numpy as np

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


@kernel(inline=True)
def product(first, second, out):
    """out = first @ second, of 3 x 3."""
    for i in range(3):
        for j in range(3):
            out[i, j] = first[i, 0] * second[0, j] + first[i, 1] * second[1, j] + first[i, 2] * second[2, j]


@kernel(inline=True)
def turned(rotation, x, y, z, out):
    """out = rotation Exp((x, y, z)) (Rodrigues)."""
    squared = x * x + y * y + z * z
    angle = math.sqrt(squared)
    if squared < 1e-12:
        once, twice = 1.0 - squared / 6.0, 0.5 - squared / 24.0
    else:
        once, twice = math.sin(angle) / angle, (1.0 - math.cos(angle)) / squared
    turn = np.empty((3, 3))
    turn[0, 0], turn[1, 1], turn[2, 2] = (
        1.0 - twice * (y * y + z * z), 1.0 - twice * (x * x + z * z), 1.0 - twice * (x * x + y * y),
    )  # fmt: skip
    turn[0, 1], turn[0, 2], turn[1, 2] = twice * x * y - once * z, twice * x * z + once * y, twice * y * z - once * x
    turn[1, 0], turn[2, 0], turn[2, 1] = twice * x * y + once * z, twice * x * z - once * y, twice * y * z + once * x
    product(rotation, turn, out)
