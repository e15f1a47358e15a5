"""Resampling kernels: the moments of a grid's density, and values and lost solids of a grid rotated against another.

Twin of `moments(scale softplus(refined(raw)))` in field/edit/bake.py: a cell has two points along each axis, a
quarter of it from its ends, which belong to its two nodes by 3/4 and 1/4. Twins of field/edit/resample.py and
field/edit/conservative_occupancy.py: coordinates of the new grid become those of the old one by g_old = matrix g_new
+ shift.
"""

import math

import numpy as np

from nerfnav.core.jit import kernel, prange
from nerfnav.field.kernels.cells import BLOCK_SHIFT, NEGLIGIBLE_RAW, cell_of, corner_weights, interpolate, softplus


@kernel()
def pair(side, point):
    """Weight of a cell's node (0 or 1) at its point (0 or 1)."""
    return np.float32(0.75) if side == point else np.float32(0.25)


@kernel()
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


@kernel()
def to_old(matrix, shift, x, y, z, axis):
    """One coordinate in the old grid of a point of the new one."""
    return matrix[axis, 0] * x + matrix[axis, 1] * y + matrix[axis, 2] * z + shift[axis]


@kernel()
def has_density(occupied, shape, x, y, z):
    """Check that the block of grid coordinates has density; those of the border belong to the last cell."""
    i = max(0, min(int(x), shape[0] - 2)) >> BLOCK_SHIFT
    j = max(0, min(int(y), shape[1] - 2)) >> BLOCK_SHIFT
    k = max(0, min(int(z), shape[2] - 2)) >> BLOCK_SHIFT
    return occupied[i, j, k] != 0


@kernel()
def outside(x, y, z, shape):
    """Check that grid coordinates lie outside the grid, by more than rounding."""
    low, nx, ny, nz = -1e-3, shape[0] - 1 + 1e-3, shape[1] - 1 + 1e-3, shape[2] - 1 + 1e-3
    return not (low <= x <= nx and low <= y <= ny and low <= z <= nz)


@kernel()
def raw_at(values, x, y, z):
    """Raw density between the corners of the cell that holds grid coordinates."""
    nx, ny, nz, _ = values.shape
    i, u = cell_of(np.float32(x), nx)
    j, v = cell_of(np.float32(y), ny)
    k, w = cell_of(np.float32(z), nz)
    low = (values[i, j, k, 0] * (1 - w) + values[i, j, k + 1, 0] * w) * (1 - v)
    low += (values[i, j + 1, k, 0] * (1 - w) + values[i, j + 1, k + 1, 0] * w) * v
    high = (values[i + 1, j, k, 0] * (1 - w) + values[i + 1, j, k + 1, 0] * w) * (1 - v)
    high += (values[i + 1, j + 1, k, 0] * (1 - w) + values[i + 1, j + 1, k + 1, 0] * w) * v
    return low * (1 - u) + high * u


@kernel()
def add_sample(values, place, factor, corners, total, out):
    """Add density and, weighted by it, colours at grid coordinates `place`, each `factor` times."""
    i, u = cell_of(np.float32(place[0]), values.shape[0])
    j, v = cell_of(np.float32(place[1]), values.shape[1])
    k, w = cell_of(np.float32(place[2]), values.shape[2])
    corner_weights(u, v, w, corners)
    density = factor * softplus(interpolate(values, 0, i, j, k, corners))
    for channel in range(1, 4):
        out[channel] += density * interpolate(values, channel, i, j, k, corners)
    return total + density


@kernel(parallel=True)
def measure_turned(values, occupied, scale, matrix, shift, offsets, weights, out):
    """Fill `out` (nx, ny, nz, 4) with densities [1/m] and colours, means over points around each new node.

    The points are `offsets` (m, 3) in new grid coordinates, with `weights` (m); nodes without density stay as they are.
    """
    for i in prange(out.shape[0]):
        corners, place = np.empty(8, np.float32), np.empty(3)
        for j in range(out.shape[1]):
            for k in range(out.shape[2]):
                total, found = np.float32(0.0), np.zeros(4, np.float32)
                for m in range(offsets.shape[0]):
                    x, y, z = i + offsets[m, 0], j + offsets[m, 1], k + offsets[m, 2]
                    for axis in range(3):
                        place[axis] = to_old(matrix, shift, x, y, z, axis)
                    if outside(place[0], place[1], place[2], values.shape):
                        continue
                    if has_density(occupied, values.shape, place[0], place[1], place[2]):
                        total = add_sample(values, place, scale * weights[m], corners, total, found)
                if total > 0:
                    out[i, j, k, 0] = total
                    for channel in range(1, 4):
                        out[i, j, k, channel] = found[channel] / total


@kernel()
def frees(now, i, j, k, at, lattice, limit):
    """Check that lattice point `at` (a, b, c) of a new cell, or one beside it within reach, is free."""
    parts, reach = lattice
    for a in range(max(0, at[0] - reach), min(parts, at[0] + reach) + 1):
        for b in range(max(0, at[1] - reach), min(parts, at[1] + reach) + 1):
            for c in range(max(0, at[2] - reach), min(parts, at[2] + reach) + 1):
                if raw_at(now, i + a / parts, j + b / parts, k + c / parts) <= limit:
                    return True
    return False


@kernel()
def loses(before, occupied, now, matrix, shift, cell, lattice, limits):
    """Check that part of cell (i, j, k) is solid in the old grid and free, there or beside it, in the new one."""
    i, j, k = cell
    side = lattice[0] + 1
    for point in range(side * side * side):
        at = (point // (side * side), point // side % side, point % side)
        x, y, z = i + at[0] / lattice[0], j + at[1] / lattice[0], k + at[2] / lattice[0]
        u, v = to_old(matrix, shift, x, y, z, 0), to_old(matrix, shift, x, y, z, 1)
        w = to_old(matrix, shift, x, y, z, 2)
        if outside(u, v, w, before.shape) or not has_density(occupied, before.shape, u, v, w):
            continue
        if raw_at(before, u, v, w) > limits[0] and frees(now, i, j, k, at, lattice, limits[1]):
            return True
    return False


@kernel(parallel=True)
def mark_lost(before, occupied, now, cells, matrix, shift, lattice, limits):
    """Leave in `cells` (cx, cy, cz), 1 where they are to be looked at, those that lose something solid.

    `before` and `now` are the values of both grids, `lattice` the parts of a cell's edge and the reach of its points,
    `limits` the raw densities above which something is solid in the one and in the other.
    """
    for i in prange(cells.shape[0]):
        for j in range(cells.shape[1]):
            for k in range(cells.shape[2]):
                if cells[i, j, k]:
                    cells[i, j, k] = loses(before, occupied, now, matrix, shift, (i, j, k), lattice, limits)
