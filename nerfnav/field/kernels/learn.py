"""A training step: forward and closed-form backward; Adam is in adam.py.

For a ray with colour C = sum_i w_i c_i + T_end b and loss L with g = dL/dC:

    dL/dc_i   = w_i g
    dL/drho_i = step (T_{i+1} c_i . g  -  sum_{j>i} w_j c_j . g  -  T_end b . g)

(the second line because all light behind sample i shrinks by exp(-rho_i step)). The shells of the surroundings are
further samples behind those in the box, with an optical depth in place of rho_i step. Each thread adds up gradients
in an array of its own, always for the same rays and in the same order: the result is the same bit for bit whenever
the number of threads is the same. Gradients and moments exist for those blocks only that have a slot.
"""

import math

import numpy as np

from nerfnav.compiled import kernel, prange
from nerfnav.field.kernels.cells import (
    BLOCK_SHIFT,
    NEGLIGIBLE_RAW,
    corner_weights,
    interpolate,
    node_in_block,
    sigmoid,
    softplus,
)
from nerfnav.field.kernels.march import STOPPED, grid_ray, locate, next_sample, sample_count, scratch
from nerfnav.field.kernels.shells import RAW_TO_DEPTH, cross_shell, shell_count


@kernel(inline=True)
def mixed(nodes, channel, first, along, weights):
    """One channel between the 8 corners of a cell whose first node is `first` of `nodes` (n, 4).

    `along` are the distances of neighbours along x, y and z in `nodes`. All are unsigned: numba then need not ask of
    each index whether it counts from the end, which takes as long as the rest.
    """
    x, y, z = along
    return (
        weights[0] * nodes[first, channel]
        + weights[1] * nodes[first + z, channel]
        + weights[2] * nodes[first + y, channel]
        + weights[3] * nodes[first + y + z, channel]
        + weights[4] * nodes[first + x, channel]
        + weights[5] * nodes[first + x + z, channel]
        + weights[6] * nodes[first + x + y, channel]
        + weights[7] * nodes[first + x + y + z, channel]
    )


@kernel(inline=True)
def scatter(gradient, touched, slots, cell, weights, by_value):
    """Add the gradient of a sample's four channels to the 8 corners of its cell, and mark their blocks."""
    density, red, green, blue = by_value[0], by_value[1], by_value[2], by_value[3]
    for corner in range(8):
        x, y, z = cell[0] + (corner >> 2), cell[1] + ((corner >> 1) & 1), cell[2] + (corner & 1)
        slot = slots[np.uint64(x >> BLOCK_SHIFT), np.uint64(y >> BLOCK_SHIFT), np.uint64(z >> BLOCK_SHIFT)]
        if slot < 0:
            continue
        block, node = np.uint64(slot), np.uint64(node_in_block(x, y, z))
        weight = weights[corner]
        gradient[block, node, 0] += weight * density
        gradient[block, node, 1] += weight * red
        gradient[block, node, 2] += weight * green
        gradient[block, node, 3] += weight * blue
        touched[block] = 1


@kernel(parallel=True)
def loss_and_gradient(grid, rays, scales, background, inner, outer):
    """Summed squared colour error of rays; adds its derivative to gradients[t] and marks touched[t] of thread t.

    `grid` = (values, occupied, lower, per_meter); `rays` = (origins, directions, jitter, targets), of which jitter (n)
    moves all samples of a ray by a share of a step, from -0.5 to 0.5; `scales` = (scale, step, sparsity, unit).
    `inner` = (slots, gradients, touched) of the box, `outer` = (values, slots, gradients, touched) of the surroundings,
    whose values have the shape (0, 0, 0, 4) where there are none. Per-ray errors (n) are returned.
    `sparsity` weighs the integral of log(1 + 2 rho^2) along the visible ray, with rho in 1 / unit and lengths in
    units, so that a place may be of any size; it drives thin fog away (Hedman et
    al., "Baking neural radiance fields", ICCV 2021); it counts in the gradient, not in the errors.
    """
    values, occupied, lower, per_meter = grid
    origins, directions, jitter, targets = rays
    scale, step, sparsity, unit = scales
    slots, gradients, touched = inner
    outer_values, outer_slots, outer_gradients, outer_touched = outer
    count, workers, shape = origins.shape[0], gradients.shape[0], values.shape
    nodes = outer_values.shape[0]
    shells = shell_count(nodes)
    most_inside = 4 * (shape[0] + shape[1] + shape[2])
    longest = most_inside + shells
    nodes_of = values.reshape((-1, 4))
    strides = np.uint64(shape[1] * shape[2]), np.uint64(shape[2]), np.uint64(1)
    errors = np.zeros(count, np.float32)
    for worker in prange(workers):
        start, slope, cell, fraction, weights = scratch()
        kept = np.empty(longest, np.int64)
        kept_light = np.empty(longest, np.float32)
        kept_weight = np.empty(longest, np.float32)
        kept_raw = np.empty(longest, np.float32)
        kept_color = np.empty((longest, 3), np.float32)
        by_value = np.empty(4, np.float32)
        for ray in range(worker * count // workers, (worker + 1) * count // workers):
            enter, leave = grid_ray(origins[ray], directions[ray], lower, per_meter, shape, start, slope)
            samples = sample_count(enter, leave, step)
            enter += jitter[ray] * step
            color = np.zeros(3, np.float32)
            light = np.float32(1.0)
            index, found = 0, 0
            while index < samples and light > STOPPED and found < most_inside:
                locate(index, enter, step, start, slope, shape, cell, fraction)
                following = next_sample(index, enter, step, start, slope, cell, occupied)
                if following > index:
                    index = following
                    continue
                i, j, k = cell[0], cell[1], cell[2]
                corner_weights(fraction[0], fraction[1], fraction[2], weights)
                node = np.uint64((i * shape[1] + j) * shape[2] + k)
                raw = mixed(nodes_of, 0, node, strides, weights)
                if raw > NEGLIGIBLE_RAW:
                    through = np.float32(math.exp(-scale * softplus(raw) * step))
                    weight = light * (np.float32(1.0) - through)
                    light *= through
                    for channel in range(3):
                        shade = mixed(nodes_of, channel + 1, node, strides, weights)
                        kept_color[found, channel] = shade
                        color[channel] += weight * shade
                    kept[found], kept_light[found] = index, light
                    kept_weight[found], kept_raw[found] = weight, raw
                    found += 1
                index += 1
            inside, shell = found, 0
            while shell < shells and light > STOPPED:
                position = np.float32(shell) + np.float32(0.98) * jitter[ray]
                if cross_shell(position, nodes, start, slope, shape, cell, fraction) >= np.float32(0.0):
                    i, j, k = cell[0], cell[1], cell[2]
                    corner_weights(fraction[0], fraction[1], fraction[2], weights)
                    raw = interpolate(outer_values, 0, i, j, k, weights)
                    through = np.float32(0.0)
                    if shell + 1 < shells:
                        through = np.float32(math.exp(-RAW_TO_DEPTH * softplus(raw)))
                    weight = light * (np.float32(1.0) - through)
                    light *= through
                    for channel in range(3):
                        shade = interpolate(outer_values, channel + 1, i, j, k, weights)
                        kept_color[found, channel] = shade
                        color[channel] += weight * shade
                    kept[found], kept_light[found] = shell, light
                    kept_weight[found], kept_raw[found] = weight, raw
                    found += 1
                shell += 1
            behind = np.float32(0.0)
            for channel in range(3):
                difference = color[channel] + light * background[channel] - targets[ray, channel]
                errors[ray] += difference * difference
                color[channel] = np.float32(2.0) * difference  # from here on g = dL/dC
                behind += light * background[channel] * color[channel]
            for sample in range(found - 1, -1, -1):
                along = np.float32(0.0)
                for channel in range(3):
                    along += kept_color[sample, channel] * color[channel]
                    by_value[channel + 1] = kept_weight[sample] * color[channel]
                raw = kept_raw[sample]
                by_depth = kept_light[sample] * along - behind
                behind += kept_weight[sample] * along
                if sample >= inside:
                    last = kept[sample] + 1 == shells  # opaque, whatever its raw density
                    by_value[0] = np.float32(0.0) if last else by_depth * RAW_TO_DEPTH * sigmoid(raw)
                    position = np.float32(kept[sample]) + np.float32(0.98) * jitter[ray]
                    cross_shell(position, nodes, start, slope, shape, cell, fraction)
                    corner_weights(fraction[0], fraction[1], fraction[2], weights)
                    scatter(outer_gradients[worker], outer_touched[worker], outer_slots, cell, weights, by_value)
                else:
                    density = unit * scale * softplus(raw)
                    thinning = sparsity * np.float32(4.0) * density / (np.float32(1.0) + np.float32(2.0) * density**2)
                    by_value[0] = step * (by_depth + thinning) * scale * sigmoid(raw)
                    locate(kept[sample], enter, step, start, slope, shape, cell, fraction)
                    corner_weights(fraction[0], fraction[1], fraction[2], weights)
                    scatter(gradients[worker], touched[worker], slots, cell, weights, by_value)
    return errors
