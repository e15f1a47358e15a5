"""A training step: forward, closed-form backward and Adam (Kingma and Ba, 2015).

For a ray with colour C = sum_i w_i c_i + T_end b and loss L with g = dL/dC:

    dL/dc_i   = w_i g
    dL/drho_i = step (T_{i+1} c_i . g  -  sum_{j>i} w_j c_j . g  -  T_end b . g)

(the second line because all light behind sample i shrinks by exp(-rho_i step)). Each thread adds up gradients in an
array of its own, always for the same rays and in the same order: the result is the same bit for bit whenever the
number of threads is the same.
"""

import math

import numba
import numpy as np

from nerfnav.compiled import kernel
from nerfnav.field.kernels.cells import (
    BLOCK_SHIFT,
    NEGLIGIBLE_RAW,
    corner_weights,
    interpolate,
    sigmoid,
    softplus,
)
from nerfnav.field.kernels.march import STOPPED, grid_ray, locate, next_sample, sample_count, scratch

FIRST, SECOND = np.float32(0.9), np.float32(0.99)
"""Adam's beta_1 and beta_2."""


@kernel(inline=True)
def scatter(gradient, touched, i, j, k, weights, g0, g1, g2, g3):
    """Add the gradient of a sample's four channels to the 8 corners of its cell, and mark their blocks."""
    for corner in range(8):
        x, y, z = i + (corner >> 2), j + ((corner >> 1) & 1), k + (corner & 1)
        weight = weights[corner]
        gradient[x, y, z, 0] += weight * g0
        gradient[x, y, z, 1] += weight * g1
        gradient[x, y, z, 2] += weight * g2
        gradient[x, y, z, 3] += weight * g3
        touched[x >> BLOCK_SHIFT, y >> BLOCK_SHIFT, z >> BLOCK_SHIFT] = 1


@kernel(parallel=True)
def loss_and_gradient(
    values, occupied, lower, per_meter, origins, directions, jitter, targets, scale, step, background,
    sparsity, gradients, touched,
):  # fmt: skip
    """Summed squared colour error of rays; adds its derivative to gradients[t] and marks touched[t] of thread t.

    `jitter` (n) moves all samples of a ray by a share of a step, from -0.5 to 0.5. Per-ray errors (n) are returned.
    `sparsity` weighs the integral of log(1 + 2 rho^2) along the visible ray, which drives thin fog away (Hedman et
    al., "Baking neural radiance fields", ICCV 2021); it counts in the gradient, not in the errors.
    """
    count = origins.shape[0]
    workers = gradients.shape[0]
    shape = values.shape
    longest = 4 * (shape[0] + shape[1] + shape[2])
    errors = np.zeros(count, np.float32)
    for worker in numba.prange(workers):
        start, slope, cell, fraction, weights = scratch()
        kept = np.empty(longest, np.int64)
        kept_light = np.empty(longest, np.float32)
        kept_weight = np.empty(longest, np.float32)
        kept_raw = np.empty(longest, np.float32)
        kept_color = np.empty((longest, 3), np.float32)
        gradient, marks = gradients[worker], touched[worker]
        for ray in range(worker * count // workers, (worker + 1) * count // workers):
            enter, leave = grid_ray(origins[ray], directions[ray], lower, per_meter, shape, start, slope)
            samples = sample_count(enter, leave, step)
            enter += jitter[ray] * step
            color = np.zeros(3, np.float32)
            light = np.float32(1.0)
            index, found = 0, 0
            while index < samples and light > STOPPED and found < longest:
                locate(index, enter, step, start, slope, shape, cell, fraction)
                following = next_sample(index, enter, step, start, slope, cell, occupied)
                if following > index:
                    index = following
                    continue
                i, j, k = cell[0], cell[1], cell[2]
                corner_weights(fraction[0], fraction[1], fraction[2], weights)
                raw = interpolate(values, 0, i, j, k, weights)
                if raw > NEGLIGIBLE_RAW:
                    through = np.float32(math.exp(-scale * softplus(raw) * step))
                    weight = light * (np.float32(1.0) - through)
                    light *= through
                    for channel in range(3):
                        shade = interpolate(values, channel + 1, i, j, k, weights)
                        kept_color[found, channel] = shade
                        color[channel] += weight * shade
                    kept[found], kept_light[found] = index, light
                    kept_weight[found], kept_raw[found] = weight, raw
                    found += 1
                index += 1
            behind = np.float32(0.0)
            for channel in range(3):
                difference = color[channel] + light * background[channel] - targets[ray, channel]
                errors[ray] += difference * difference
                color[channel] = np.float32(2.0) * difference  # from here on g = dL/dC
                behind += light * background[channel] * color[channel]
            for sample in range(found - 1, -1, -1):
                locate(kept[sample], enter, step, start, slope, shape, cell, fraction)
                corner_weights(fraction[0], fraction[1], fraction[2], weights)
                along = np.float32(0.0)
                for channel in range(3):
                    along += kept_color[sample, channel] * color[channel]
                weight, raw = kept_weight[sample], kept_raw[sample]
                density = scale * softplus(raw)
                thinning = sparsity * np.float32(4.0) * density / (np.float32(1.0) + np.float32(2.0) * density**2)
                by_density = step * (kept_light[sample] * along - behind + thinning)
                behind += weight * along
                scatter(
                    gradient, marks, cell[0], cell[1], cell[2], weights,
                    by_density * scale * sigmoid(raw), weight * color[0], weight * color[1], weight * color[2],
                )  # fmt: skip
    return errors


@kernel(parallel=True)
def adam(values, gradients, touched, first, second, rates, rate_scale, bounds, corrections):
    """Sum the threads' gradients and take a step of Adam on touched blocks, in place; clears gradients and marks.

    `rates` (4) are learning rates of the channels, `rate_scale` (nx, ny, nz) scales that of the density,
    `bounds` (2, 4) limit the values, `corrections` are 1 - beta^t of both moments. Nodes without gradient rest.
    """
    nx, ny, nz, channels = values.shape
    workers, bx, by, bz = touched.shape
    side = 1 << BLOCK_SHIFT
    for block in numba.prange(bx * by * bz):
        x0, y0, z0 = block // (by * bz), (block // bz) % by, block % bz
        active = False
        for worker in range(workers):
            active = active or touched[worker, x0, y0, z0] != 0
            touched[worker, x0, y0, z0] = 0
        if not active:
            continue
        for x in range(x0 * side, min(nx, (x0 + 1) * side)):
            for y in range(y0 * side, min(ny, (y0 + 1) * side)):
                for z in range(z0 * side, min(nz, (z0 + 1) * side)):
                    for channel in range(channels):
                        slope = np.float32(0.0)
                        for worker in range(workers):
                            slope += gradients[worker, x, y, z, channel]
                            gradients[worker, x, y, z, channel] = np.float32(0.0)
                        if slope == np.float32(0.0):
                            continue
                        mean = FIRST * first[x, y, z, channel] + (np.float32(1.0) - FIRST) * slope
                        square = SECOND * second[x, y, z, channel] + (np.float32(1.0) - SECOND) * slope * slope
                        first[x, y, z, channel] = mean
                        second[x, y, z, channel] = square
                        rate = rates[channel] * (rate_scale[x, y, z] if channel == 0 else np.float32(1.0))
                        size = np.float32(math.sqrt(square / corrections[1])) + np.float32(1e-15)
                        moved = values[x, y, z, channel] - rate * (mean / corrections[0]) / size
                        values[x, y, z, channel] = min(max(moved, bounds[0, channel]), bounds[1, channel])
