"""Sparse depth loss: the gradient of the likelihood that rays end in a band around seen points, and not before.

With the transmittance T up to the band and the optical depth O in it, a ray that ends there has the probability
p = T (1 - exp(-O)), and the loss is L = -log(p + CHANCE): some points are where nothing is. With o of a sample,

    dL/do = p / (p + CHANCE)  before the band,    -T exp(-O) / (p + CHANCE)  in it.

Rays with a known end are those of Rematas et al., "Urban radiance fields" (CVPR 2022), the likelihood of a ray's end
that of Deng et al., "Depth-supervised NeRF" (CVPR 2022).
"""

import numpy as np

from nerfnav.core.jit import kernel, prange
from nerfnav.field.kernels.learn import between_entries, keep_in_box, scatter
from nerfnav.field.kernels.march import grid_ray

CHANCE = np.float32(0.05)
"""Probability that is given to points that are where nothing is."""


@kernel(parallel=True)
def seen_points_gradient(grid, rays, scales, inner):
    """Adds the derivative of the summed loss, times its weight, to gradients[t], and marks touched[t] of thread t.

    `grid`, `inner` as for `loss_and_gradient`; `rays` = (origins, directions, jitter, distances) of points (n) [m];
    `scales` = (step, half of the band's width [m], weight, table).
    """
    origins, directions, jitter, distances = rays
    step, reach, weight, table = scales
    slots, gradients, touched = inner
    count, workers, shape = origins.shape[0], gradients.shape[0], grid[0].shape
    longest = 4 * (shape[0] + shape[1] + shape[2])
    for worker in prange(workers):
        start, slope = np.empty(3, np.float32), np.empty(3, np.float32)
        sample = np.empty(3, np.int64), np.empty(3, np.float32)
        rows, raws = np.empty((2, longest, 5), np.float32), np.empty((2, longest), np.float32)
        cells, corners = np.empty((2, longest, 3), np.int64), np.empty((2, longest, 8), np.float32)
        by_value, pull = np.zeros(4, np.float32), np.empty(2, np.float32)
        found = np.empty(2, np.int64)
        for ray in range(worker * count // workers, (worker + 1) * count // workers):
            enter, leave = grid_ray(origins[ray], directions[ray], grid[2], grid[3], shape, start, slope)
            enter += jitter[ray] * step
            first, behind = band(enter, leave, distances[ray], reach, step)
            if behind <= first:
                continue
            march = start, slope, enter, first, step
            kept = rows[0], raws[0], cells[0], corners[0]
            found[0], clear = keep_in_box(grid, march, table, sample, kept)
            march = start, slope, enter + np.float32(first) * step, behind - first, step
            kept = rows[1], raws[1], cells[1], corners[1]
            found[1], through = keep_in_box(grid, march, table, sample, kept)
            ends = clear * (np.float32(1.0) - through)
            pull[0], pull[1] = weight * ends / (ends + CHANCE), -weight * clear * through / (ends + CHANCE)
            for part in range(2):
                for index in range(found[part]):
                    by_value[0] = pull[part] * between_entries(table, raws[part, index], 1)
                    cell, weights = cells[part, index], corners[part, index]
                    scatter(gradients[worker], touched[worker], slots, cell, weights, by_value)


@kernel(inline=True)
def band(enter, leave, distance, reach, step):
    """The first sample of a ray in the band around a point, and the first behind it or the box."""
    most = int((leave - enter) / step)
    first = min(most, max(0, int(np.floor((distance - reach - enter) / step))))
    return first, min(most, int(np.ceil((distance + reach - enter) / step)))
