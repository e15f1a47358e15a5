"""Grid cells: find the cell of a point, interpolate density and its gradient in it, and find where a ray crosses it.

A grid is dense, values (nx, ny, nz, channels) with `occupied` (bx, by, bz) telling which blocks of 4 x 4 x 4 cells
hold anything; or in bricks, values (bricks, 5, 5, 5, channels) with the nodes of those blocks alone, borders
included, where `occupied` has each block's brick, 0 for the empty one. Which it is, is known when a kernel is
compiled: a dense grid pays nothing for it.
"""

import math

import numpy as np

from nerfnav.core.jit import kernel, prange

BLOCK_SHIFT = 2
"""Blocks of the occupancy have 2**BLOCK_SHIFT cells along each side."""
NEGLIGIBLE_RAW = np.float32(-16.0)
"""softplus below this is under 1.2e-7: no density."""


@kernel()
def node_counts(values, lower):
    """Numbers of nodes along x, y, z; of a grid in bricks they stand behind the corner in `lower` (6)."""
    if values.ndim == 5:
        return int(lower[3]), int(lower[4]), int(lower[5])
    return values.shape[0], values.shape[1], values.shape[2]


@kernel()
def part_of(values, occupied, i, j, k):
    """The dense values that hold cell (i, j, k), and its index in them: all, or the brick of its block."""
    if values.ndim == 5:
        inner = (1 << BLOCK_SHIFT) - 1
        slot = occupied[i >> BLOCK_SHIFT, j >> BLOCK_SHIFT, k >> BLOCK_SHIFT]
        return values[slot], i & inner, j & inner, k & inner
    return values, i, j, k


@kernel()
def softplus(x):
    """log(1 + exp(x)) without overflow."""
    return x if x > np.float32(15.0) else np.float32(math.log1p(math.exp(x)))


@kernel()
def sigmoid(x):
    """The derivative of softplus."""
    return np.float32(1.0) / (np.float32(1.0) + np.float32(math.exp(-x)))


@kernel()
def cell_of(coordinate, count):
    """Index of the cell that holds a grid coordinate, and the fraction within it (both clamped to the grid)."""
    clamped = min(max(coordinate, np.float32(0.0)), np.float32(count - 1))
    index = min(int(clamped), count - 2)
    return index, np.float32(clamped - np.float32(index))


@kernel()
def corner_weights(x, y, z, weights):
    """Trilinear weights of the 8 corners of a cell, z fastest, written into `weights`."""
    one = np.float32(1.0)
    xy00, xy01, xy10, xy11 = (one - x) * (one - y), (one - x) * y, x * (one - y), x * y
    weights[0], weights[1] = xy00 * (one - z), xy00 * z
    weights[2], weights[3] = xy01 * (one - z), xy01 * z
    weights[4], weights[5] = xy10 * (one - z), xy10 * z
    weights[6], weights[7] = xy11 * (one - z), xy11 * z


@kernel()
def interpolate(values, channel, i, j, k, weights):
    """One channel between the 8 corners of cell (i, j, k)."""
    return (
        weights[0] * values[i, j, k, channel]
        + weights[1] * values[i, j, k + 1, channel]
        + weights[2] * values[i, j + 1, k, channel]
        + weights[3] * values[i, j + 1, k + 1, channel]
        + weights[4] * values[i + 1, j, k, channel]
        + weights[5] * values[i + 1, j, k + 1, channel]
        + weights[6] * values[i + 1, j + 1, k, channel]
        + weights[7] * values[i + 1, j + 1, k + 1, channel]
    )


@kernel()
def between(values, channel, i, j, k, x, y, z):
    """Value of a channel at a fraction (x, y, z) of a cell."""
    near00, near01 = values[i, j, k, channel], values[i, j + 1, k, channel]
    near10, near11 = values[i + 1, j, k, channel], values[i + 1, j + 1, k, channel]
    edge00 = near00 + z * (values[i, j, k + 1, channel] - near00)
    edge01 = near01 + z * (values[i, j + 1, k + 1, channel] - near01)
    edge10 = near10 + z * (values[i + 1, j, k + 1, channel] - near10)
    edge11 = near11 + z * (values[i + 1, j + 1, k + 1, channel] - near11)
    face0, face1 = edge00 + y * (edge01 - edge00), edge10 + y * (edge11 - edge10)
    return face0 + x * (face1 - face0)


@kernel()
def slopes_between(values, channel, i, j, k, x, y, z):
    """Value of a channel at a fraction (x, y, z) of a cell, and its gradient [1 / node].

    Indices are made unsigned: numba then need not ask of each whether it counts from the end.
    """
    one, next_one = np.float32(1.0), np.uint64(1)
    i, j, k = np.uint64(i), np.uint64(j), np.uint64(k)
    up, right, on = i + next_one, j + next_one, k + next_one
    near00, far00 = values[i, j, k, channel], values[i, j, on, channel]
    near01, far01 = values[i, right, k, channel], values[i, right, on, channel]
    near10, far10 = values[up, j, k, channel], values[up, j, on, channel]
    near11, far11 = values[up, right, k, channel], values[up, right, on, channel]
    edge00, edge01 = near00 + z * (far00 - near00), near01 + z * (far01 - near01)
    edge10, edge11 = near10 + z * (far10 - near10), near11 + z * (far11 - near11)
    face0, face1 = edge00 + y * (edge01 - edge00), edge10 + y * (edge11 - edge10)
    by_y = (one - x) * (edge01 - edge00) + x * (edge11 - edge10)
    along0 = (one - y) * (far00 - near00) + y * (far01 - near01)
    along1 = (one - y) * (far10 - near10) + y * (far11 - near11)
    return face0 + x * (face1 - face0), face1 - face0, by_y, (one - x) * along0 + x * along1


@kernel()
def slab(start, slope, count, enter, leave):
    """Narrow the interval [enter, leave] of a ray to one axis of the grid; coordinates run from 0 to count - 1."""
    if abs(slope) < np.float32(1e-9):
        inside = np.float32(0.0) <= start <= np.float32(count - 1)
        return enter, leave if inside else enter - np.float32(1.0)
    first = -start / slope
    second = (np.float32(count - 1) - start) / slope
    return max(enter, min(first, second)), min(leave, max(first, second))


@kernel()
def cube_exit(start, slope, cell, shift):
    """Distance along a ray at which it leaves, along one axis, the cube of 2^shift cells a side that holds `cell`."""
    if abs(slope) < np.float32(1e-9):
        return np.float32(np.inf)
    cube = (cell >> shift) + (1 if slope > np.float32(0.0) else 0)
    return (np.float32(cube << shift) - start) / slope


@kernel()
def node_in_block(x, y, z):
    """Index of a node among the 64 of its block."""
    return ((x & 3) << 4) | ((y & 3) << 2) | (z & 3)


POINTS_AT_ONCE = 256
"""Points that one thread takes at a time."""


@kernel()
def density_of_rows(values, occupied, lower, per_meter, scale, points, rows, density, gradient):
    """rho [1/m] at the points of some rows (first, end) and d rho / d p [1/m^2]; zero outside the grid.

    One loop and no call for each point: handing arrays over would take longer than what is done with them.
    """
    nx, ny, nz = node_counts(values, lower)
    for n in range(rows[0], rows[1]):
        density[n], gradient[n, 0], gradient[n, 1], gradient[n, 2] = 0.0, 0.0, 0.0, 0.0
        x = (points[n, 0] - lower[0]) * per_meter[0]
        y = (points[n, 1] - lower[1]) * per_meter[1]
        z = (points[n, 2] - lower[2]) * per_meter[2]
        if not (0.0 <= x <= nx - 1 and 0.0 <= y <= ny - 1 and 0.0 <= z <= nz - 1):
            continue
        i, j, k = min(int(x), nx - 2), min(int(y), ny - 2), min(int(z), nz - 2)
        if not occupied[i >> BLOCK_SHIFT, j >> BLOCK_SHIFT, k >> BLOCK_SHIFT]:
            continue
        x, y, z = x - i, y - j, z - k
        part, i, j, k = part_of(values, occupied, i, j, k)
        # along z at the four edges, then along y at the two faces, then along x
        edge00, slope00 = part[i, j, k, 0], part[i, j, k + 1, 0] - part[i, j, k, 0]
        edge01, slope01 = part[i, j + 1, k, 0], part[i, j + 1, k + 1, 0] - part[i, j + 1, k, 0]
        edge10, slope10 = part[i + 1, j, k, 0], part[i + 1, j, k + 1, 0] - part[i + 1, j, k, 0]
        edge11, slope11 = part[i + 1, j + 1, k, 0], part[i + 1, j + 1, k + 1, 0] - part[i + 1, j + 1, k, 0]
        edge00, edge01 = edge00 + z * slope00, edge01 + z * slope01
        edge10, edge11 = edge10 + z * slope10, edge11 + z * slope11
        near, far = edge00 + y * (edge01 - edge00), edge10 + y * (edge11 - edge10)
        raw = near + x * (far - near)
        if raw < NEGLIGIBLE_RAW:
            continue
        exponential = math.exp(-abs(raw))
        density[n] = scale * (max(raw, 0.0) + math.log1p(exponential))
        slope = scale * (1.0 if raw > 0.0 else exponential) / (1.0 + exponential)
        gradient[n, 0] = slope * per_meter[0] * (far - near)
        gradient[n, 1] = slope * per_meter[1] * ((1.0 - x) * (edge01 - edge00) + x * (edge11 - edge10))
        along_z = (1.0 - x) * ((1.0 - y) * slope00 + y * slope01) + x * ((1.0 - y) * slope10 + y * slope11)
        gradient[n, 2] = slope * per_meter[2] * along_z


@kernel()
def density_and_gradient(values, occupied, lower, per_meter, scale, points, density, gradient):
    """Fill density (n) and gradient (n, 3) at points (n, 3), in one thread."""
    rows = (0, points.shape[0])
    density_of_rows(values, occupied, lower, per_meter, scale, points, rows, density, gradient)


@kernel(parallel=True)
def density_and_gradient_parallel(values, occupied, lower, per_meter, scale, points, density, gradient):
    """The same in all threads: pays from some thousand points on."""
    count = points.shape[0]
    for chunk in prange((count + POINTS_AT_ONCE - 1) // POINTS_AT_ONCE):
        rows = (chunk * POINTS_AT_ONCE, min(count, (chunk + 1) * POINTS_AT_ONCE))
        density_of_rows(values, occupied, lower, per_meter, scale, points, rows, density, gradient)
