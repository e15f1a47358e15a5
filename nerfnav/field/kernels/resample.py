"""Moments of a grid's density, for fitting it: twin of `moments(scale softplus(refined(raw)))` in field/bake.py.

A cell has two points along each axis, a quarter of it from its ends, which belong to its two nodes by 3/4 and 1/4.
"""

import math

import numpy as np

from nerfnav.core.jit import kernel, prange
from nerfnav.field.kernels.cells import NEGLIGIBLE_RAW, softplus


@kernel(inline=True)
def pair(side, point):
    """Weight of a cell's node (0 or 1) at its point (0 or 1)."""
    return np.float32(0.75) if side == point else np.float32(0.25)


@kernel(inline=True)
def add_cell(raw, scale, i, j, k, sums):
    """Add what the eight points of one cell give to its eight nodes."""
    for point in range(8):
        a, b, c = point >> 2, (point >> 1) & 1, point & 1
        mixed = np.float32(0.0)
        for node in range(8):
            x, y, z = node >> 2, (node >> 1) & 1, node & 1
            mixed += pair(x, a) * pair(y, b) * pair(z, c) * raw[i + x, j + y, k + z]
        if mixed < NEGLIGIBLE_RAW:
            continue
        density = scale * softplus(mixed)
        for node in range(8):
            x, y, z = node >> 2, (node >> 1) & 1, node & 1
            sums[i + x, j + y, k + z] += pair(x, a) * pair(y, b) * pair(z, c) * density


@kernel(parallel=True)
def add_moments(raw, scale, sums):
    """Add to `sums` (nx, ny, nz), for each node, the densities at all points around it times its weights there."""
    nx, ny, nz = raw.shape
    for parity in range(2):  # layers of cells of one parity share no nodes
        for half in prange(nx // 2):
            i = 2 * half + parity
            if i >= nx - 1:
                continue
            for j in range(ny - 1):
                for k in range(nz - 1):
                    largest = np.float32(-math.inf)
                    for node in range(8):
                        largest = max(largest, raw[i + (node >> 2), j + ((node >> 1) & 1), k + (node & 1)])
                    if largest > NEGLIGIBLE_RAW:
                        add_cell(raw, scale, i, j, k, sums)
