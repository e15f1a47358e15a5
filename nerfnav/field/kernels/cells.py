"""Where a point lies in the grid, what the grid says there, and how a ray crosses it.

A grid is dense, values (nx, ny, nz, channels) with `occupied` (bx, by, bz) telling which blocks of 4 x 4 x 4 cells hold
anything; or in bricks, values (bricks, 5, 5, 5, channels) with the nodes of those blocks alone, borders included, where
`occupied` has each block's brick, 0 for the empty one. Which it is, is known when a kernel is compiled: a dense grid
pays nothing for it.
"""

import math

import numpy as np

from nerfnav.compiled import kernel

BLOCK_SHIFT = 2
"""Blocks of the occupancy have 2**BLOCK_SHIFT cells along each side."""
NEGLIGIBLE_RAW = np.float32(-16.0)
"""softplus below this is under 1.2e-7: no density."""


@kernel(inline=True)
def node_counts(values, lower):
    """Numbers of nodes along x, y, z; of a grid in bricks they stand behind the corner in `lower` (6)."""
    if values.ndim == 5:
        return int(lower[3]), int(lower[4]), int(lower[5])
    return values.shape[0], values.shape[1], values.shape[2]


@kernel(inline=True)
def part_of(values, occupied, i, j, k):
    """The dense values that hold cell (i, j, k), and its index in them: all, or the brick of its block."""
    if values.ndim == 5:
        inner = (1 << BLOCK_SHIFT) - 1
        slot = occupied[i >> BLOCK_SHIFT, j >> BLOCK_SHIFT, k >> BLOCK_SHIFT]
        return values[slot], i & inner, j & inner, k & inner
    return values, i, j, k


@kernel(inline=True)
def softplus(x):
    """log(1 + exp(x)) without overflow."""
    return x if x > np.float32(15.0) else np.float32(math.log1p(math.exp(x)))


@kernel(inline=True)
def sigmoid(x):
    """The derivative of softplus."""
    return np.float32(1.0) / (np.float32(1.0) + np.float32(math.exp(-x)))


@kernel(inline=True)
def cell_of(coordinate, count):
    """Index of the cell that holds a grid coordinate, and the fraction within it (both clamped to the grid)."""
    clamped = min(max(coordinate, np.float32(0.0)), np.float32(count - 1))
    index = min(int(clamped), count - 2)
    return index, np.float32(clamped - np.float32(index))


@kernel(inline=True)
def corner_weights(x, y, z, weights):
    """Trilinear weights of the 8 corners of a cell, z fastest, written into `weights`."""
    one = np.float32(1.0)
    xy00, xy01, xy10, xy11 = (one - x) * (one - y), (one - x) * y, x * (one - y), x * y
    weights[0], weights[1] = xy00 * (one - z), xy00 * z
    weights[2], weights[3] = xy01 * (one - z), xy01 * z
    weights[4], weights[5] = xy10 * (one - z), xy10 * z
    weights[6], weights[7] = xy11 * (one - z), xy11 * z


@kernel(inline=True)
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


@kernel(inline=True)
def slab(start, slope, count, enter, leave):
    """Narrow the interval [enter, leave] of a ray to one axis of the grid; coordinates run from 0 to count - 1."""
    if abs(slope) < np.float32(1e-9):
        inside = np.float32(0.0) <= start <= np.float32(count - 1)
        return enter, leave if inside else enter - np.float32(1.0)
    first = -start / slope
    second = (np.float32(count - 1) - start) / slope
    return max(enter, min(first, second)), min(leave, max(first, second))


@kernel(inline=True)
def block_exit(start, slope, cell):
    """Distance along the ray at which it leaves, along one axis, the block that holds `cell`."""
    if abs(slope) < np.float32(1e-9):
        return np.float32(np.inf)
    block = cell >> BLOCK_SHIFT
    border = (block + 1) << BLOCK_SHIFT if slope > np.float32(0.0) else block << BLOCK_SHIFT
    return (np.float32(border) - start) / slope


@kernel(inline=True)
def node_in_block(x, y, z):
    """Where a node's numbers stand among the 64 of its block."""
    return ((x & 3) << 4) | ((y & 3) << 2) | (z & 3)
