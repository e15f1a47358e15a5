"""Adam (Kingma and Ba, 2015) on the blocks of a grid that have a slot, and the roughness of what rays have touched."""

import math

import numpy as np

from nerfnav.core.jit import kernel, prange
from nerfnav.field.kernels.cells import BLOCK_SHIFT, node_in_block

FIRST, SECOND = np.float32(0.9), np.float32(0.99)
"""Adam's beta_1 and beta_2."""
_CHANNELS = 4
"""Raw density and colour: a number that is known when loops over it are compiled."""


@kernel()
def touched_by_any(touched, slot):
    """Check that any thread has added a gradient to a block."""
    found = False
    for worker in range(touched.shape[0]):
        found = found or touched[worker, slot] != 0
    return found


@kernel(parallel=True)
def add_roughness(values, blocks, gradients, touched, weights):
    """Add to gradients[0] that of the total variation, sum over neighbours of weight * huber(difference).

    For touched nodes only: what no ray looks at may be as rough as it likes. `weights` (4) are those of the channels.
    """
    nx, ny, nz, channels = values.shape
    workers, count = touched.shape
    side = 1 << BLOCK_SHIFT
    one = np.float32(1.0)
    for slot in prange(count):
        if not touched_by_any(touched, slot):
            continue
        x0, y0, z0 = blocks[slot, 0] * side, blocks[slot, 1] * side, blocks[slot, 2] * side
        for x in range(x0, min(nx, x0 + side)):
            for y in range(y0, min(ny, y0 + side)):
                for z in range(z0, min(nz, z0 + side)):
                    node = node_in_block(x, y, z)
                    for channel in range(channels):
                        slope = np.float32(0.0)
                        for worker in range(workers):
                            slope += gradients[worker, slot, node, channel]
                        if slope == np.float32(0.0):
                            continue
                        here, pull = values[x, y, z, channel], np.float32(0.0)
                        pull += min(max(here - values[max(x - 1, 0), y, z, channel], -one), one)
                        pull += min(max(here - values[min(x + 1, nx - 1), y, z, channel], -one), one)
                        pull += min(max(here - values[x, max(y - 1, 0), z, channel], -one), one)
                        pull += min(max(here - values[x, min(y + 1, ny - 1), z, channel], -one), one)
                        pull += min(max(here - values[x, y, max(z - 1, 0), channel], -one), one)
                        pull += min(max(here - values[x, y, min(z + 1, nz - 1), channel], -one), one)
                        gradients[0, slot, node, channel] += weights[channel] * pull


@kernel(parallel=True)
def adam(values, blocks, gradients, touched, moments, rates, rate_scale, bounds, corrections):
    """Sum the threads' gradients and take a step of Adam on touched blocks, in place; clears gradients and marks.

    `blocks` (slots, 3) says which block has which slot, `moments` (2, slots, 64, 4) are Adam's. `rates` (4) are
    learning rates of the channels, `rate_scale` (nx, ny, nz) scales that of the density, `bounds` (2, 4) limit the
    values, `corrections` are 1 - beta^t of both moments. Nodes without gradient rest.
    """
    nx, ny, nz, _ = values.shape
    workers, count = touched.shape
    side = 1 << BLOCK_SHIFT
    numbers = side * side * side * _CHANNELS
    sums, first, second = gradients.reshape((workers, count, numbers)), moments[0], moments[1]
    first, second = first.reshape((count, numbers)), second.reshape((count, numbers))
    for slot in prange(count):
        if not touched_by_any(touched, slot):
            continue
        steps = np.empty(numbers, np.float32)
        for worker in range(workers):
            if touched[worker, slot] != 0 and worker > 0:
                for n in range(numbers):
                    sums[0, slot, n] += sums[worker, slot, n]
                    sums[worker, slot, n] = np.float32(0.0)
            touched[worker, slot] = 0
        block_steps(sums[0, slot], first[slot], second[slot], corrections, steps)
        x0, y0, z0 = blocks[slot, 0] * side, blocks[slot, 1] * side, blocks[slot, 2] * side
        for x in range(x0, min(nx, x0 + side)):
            for y in range(y0, min(ny, y0 + side)):
                for z in range(z0, min(nz, z0 + side)):
                    node = _CHANNELS * node_in_block(x, y, z)
                    steps[node] *= rate_scale[x, y, z]
                    for channel in range(_CHANNELS):
                        moved = values[x, y, z, channel] - rates[channel] * steps[node + channel]
                        values[x, y, z, channel] = min(max(moved, bounds[0, channel]), bounds[1, channel])


@kernel()
def block_steps(slopes, first, second, corrections, steps):
    """Adam's steps at a rate of 1 for all numbers of a block, in order; `slopes` are used up, those of 0 rest.

    Without a branch in the loop, so that many numbers are done at once.
    """
    zero, one = np.float32(0.0), np.float32(1.0)
    inverse_first, inverse_second = one / corrections[0], one / corrections[1]
    for n in range(slopes.shape[0]):
        slope = slopes[n]
        mean = FIRST * first[n] + (one - FIRST) * slope
        square = SECOND * second[n] + (one - SECOND) * slope * slope
        rests = slope == zero
        first[n] = first[n] if rests else mean
        second[n] = second[n] if rests else square
        step = mean * inverse_first / (np.float32(math.sqrt(square * inverse_second)) + np.float32(1e-15))
        steps[n] = zero if rests else step
        slopes[n] = zero
