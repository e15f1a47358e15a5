"""Which nodes of a grid rays come by before they are stopped."""

import math

import numpy as np

from nerfnav.compiled import kernel, prange
from nerfnav.field.kernels.cells import BLOCK_SHIFT, NEGLIGIBLE_RAW, corner_weights, interpolate, softplus
from nerfnav.field.kernels.march import grid_ray, locate, sample_count, scratch

MOST = 255
"""Counting ends here."""


@kernel(parallel=True)
def count_sightings(grid, origins, directions, scale, step, least_light, counts):
    """Add to counts[t] (nx, ny, nz), for each node, the samples of thread t's rays to which it is the nearest.

    `grid` = (values, occupied, lower, per_meter). A ray counts as long as more than `least_light` of its light is left.
    """
    values, occupied, lower, per_meter = grid
    count, workers, shape = origins.shape[0], counts.shape[0], values.shape
    half = np.float32(0.5)
    for worker in prange(workers):
        start, slope, cell, fraction, weights = scratch()
        for ray in range(worker * count // workers, (worker + 1) * count // workers):
            enter, leave = grid_ray(origins[ray], directions[ray], lower, per_meter, shape, start, slope)
            light = np.float32(1.0)
            for index in range(sample_count(enter, leave, step)):
                locate(index, enter, step, start, slope, shape, cell, fraction)
                i, j, k = cell[0], cell[1], cell[2]
                if occupied[i >> BLOCK_SHIFT, j >> BLOCK_SHIFT, k >> BLOCK_SHIFT]:
                    corner_weights(fraction[0], fraction[1], fraction[2], weights)
                    raw = interpolate(values, 0, i, j, k, weights)
                    if raw > NEGLIGIBLE_RAW:
                        light *= np.float32(math.exp(-scale * softplus(raw) * step))
                        if light < least_light:
                            break
                x, y, z = i + int(fraction[0] > half), j + int(fraction[1] > half), k + int(fraction[2] > half)
                if counts[worker, x, y, z] < MOST:
                    counts[worker, x, y, z] += 1
