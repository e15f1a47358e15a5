"""Training step: rays of random pixels, the forward pass and the closed-form backward pass; Adam is in adam.py.

For a ray with colour C = sum_i w_i c_i + T_end b and loss L with g = dL/dC:

    dL/dc_i = w_i g
    dL/do_i = T_{i+1} c_i . g  -  sum_{j>i} w_j c_j . g  -  T_end b . g

(the second line because all light behind sample i, of optical depth o_i = rho_i step, shrinks by exp(-o_i)). The
shells of the surroundings are further samples behind those in the box. Each thread adds up gradients in an array of
its own, always for the same rays and in the same order: the result is the same bit for bit whenever the number of
threads is the same. Gradients and moments exist for those blocks only that have a slot.

Occupied parts: one byte for each block of 4 x 4 x 4 cells, one bit for each of its 8 parts of 2 x 2 x 2 cells, so
that rays pass what is empty within two cells of a surface and never touch its nodes.

Sparse depth loss. The gradient of the likelihood that rays end in a band around seen points, and not before.

With the transmittance T up to the band and the optical depth O in it, a ray that ends there has the probability
p = T (1 - exp(-O)), and the loss is L = -log(p + CHANCE): some points are where nothing is. With o of a sample,

    dL/do = p / (p + CHANCE)  before the band,    -T exp(-O) / (p + CHANCE)  in it.

Rays with a known end are those of Rematas et al., "Urban radiance fields" (CVPR 2022), the likelihood of a ray's end
that of Deng et al., "Depth-supervised NeRF" (CVPR 2022).
"""

import math

import numpy as np

from nerfnav.core.jit import kernel, prange
from nerfnav.field.kernels.cells import (
    BLOCK_SHIFT,
    NEGLIGIBLE_RAW,
    corner_weights,
    cube_exit,
    node_in_block,
    sigmoid,
    softplus,
)
from nerfnav.field.kernels.light import STOPPED, column_at, entry_at, tabled
from nerfnav.field.kernels.march import grid_ray, locate, sample_count
from nerfnav.field.kernels.shells import RAW_TO_DEPTH, cross_shell, shell_count


@kernel(parallel=True)
def rays_of_pixels(chosen, width, height, focal, center, rotations, positions):
    """Origins (n, 3) and unit directions (n, 3) of pixels counted through all images, row by row.

    `focal` = (fx, fy) and `center` = (cx, cy) in pixels; rotations (images, 3, 3) are R_world_camera.
    """
    count = chosen.shape[0]
    origins = np.empty((count, 3), np.float32)
    directions = np.empty((count, 3), np.float32)
    for n in prange(count):
        image, pixel = chosen[n] // (width * height), chosen[n] % (width * height)
        x = (np.float32(pixel % width) + np.float32(0.5) - center[0]) / focal[0]
        y = -(np.float32(pixel // width) + np.float32(0.5) - center[1]) / focal[1]
        scale = np.float32(1.0) / np.float32(math.sqrt(x * x + y * y + np.float32(1.0)))
        for axis in range(3):
            rotation = rotations[image, axis]
            origins[n, axis] = positions[image, axis]
            directions[n, axis] = scale * (rotation[0] * x + rotation[1] * y - rotation[2])
    return origins, directions


ALL_PARTS = 0xFF
"""The byte of a block of which every part is looked at."""


@kernel()
def parts_above(values, slots, threshold, parts):
    """Fill `parts` (bx, by, bz) with those that have a node, borders included, of raw density above the threshold.

    Blocks without a slot (`slots` < 0) have nothing to learn in.
    """
    nx, ny, nz = values.shape[0], values.shape[1], values.shape[2]
    parts[:] = 0
    for i in range(nx):
        for j in range(ny):
            for k in range(nz):
                if values[i, j, k, 0] <= threshold:
                    continue
                for before in range(8):  # a node on the border of a part belongs to that before it, too
                    x, y, z = before >> 2, (before >> 1) & 1, before & 1
                    if (x and (i & 1 or i == 0)) or (y and (j & 1 or j == 0)) or (z and (k & 1 or k == 0)):
                        continue
                    a, b, c = (i >> 1) - x, (j >> 1) - y, (k >> 1) - z
                    if slots[a >> 1, b >> 1, c >> 1] >= 0:
                        parts[a >> 1, b >> 1, c >> 1] |= np.uint8(1 << (((a & 1) << 2) | ((b & 1) << 1) | (c & 1)))


@kernel()
def empty_side(parts, i, j, k):
    """log2 of the cells along each edge of what is empty around cell (i, j, k): a part, a block; 0 where it is not."""
    byte = parts[np.uint64(i >> 2), np.uint64(j >> 2), np.uint64(k >> 2)]
    if byte == 0:
        return 2
    part = (((i >> 1) & 1) << 2) | (((j >> 1) & 1) << 1) | ((k >> 1) & 1)
    return 0 if (byte >> part) & 1 else 1


DARK = np.float32(1e-3)
"""Transmittance below which nothing is learned: Adam would move what no ray sees as far as the rest."""
FAINT = np.float32(1e-4)
"""Share of the light that a sample must stop to be learned from: about what density that is taken for none stops."""

_OPAQUE_RAW = np.float32(-np.inf)
"""Raw density that has no slope: that of what is opaque whatever is learned."""


def depth_table(scale: float, step: float, unit: float) -> np.ndarray:
    """1 - exp(-o), do/draw and what sparsity adds to dL/draw (entries, 3), by raw density from NEGLIGIBLE_RAW on.

    Samples stand for `step` [m]. Sparsity is the integral of log(1 + 2 rho^2) with rho in 1 / unit and lengths in
    units, so that a place may be of any size; it drives thin fog away (Hedman et al., "Baking neural radiance fields",
    ICCV 2021).
    """
    raw = tabled()
    density, slope = scale * np.logaddexp(0.0, raw), scale * step / (1.0 + np.exp(-raw))
    thinning = slope * 4 * unit * density / (1 + 2 * (unit * density) ** 2)
    return np.stack([-np.expm1(-step * density), slope, thinning], -1).astype(np.float32)


@kernel()
def between_entries(table, raw, column):
    """A column of `depth_table` at a raw density."""
    return column_at(table, entry_at(table, raw), column)


@kernel()
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


@kernel()
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


@kernel()
def keep(nodes, first, along, weights, passing, row):
    """Fill `row` with colour (3), weight and light behind of a sample; returns the latter.

    `passing` is the light before it, and the share of it that the sample stops.
    """
    light, stopped = passing
    row[3], row[4] = light * stopped, light * (np.float32(1.0) - stopped)
    for channel in range(3):
        row[channel] = mixed(nodes, channel + 1, first, along, weights)
    return row[4]


@kernel()
def keep_in_box(grid, march, table, sample, kept):
    """Keep what a ray meets in the box: how many samples, and the light that is left.

    `march` = (start, slope, enter, samples, step), `sample` = (cell, fraction), `kept` = (rows, raws, cells, corners):
    rows as `keep` fills them, raw densities, cells and the weights of their corners.
    """
    values, parts = grid[0], grid[1]
    start, slope, enter, samples, step = march
    cell, fraction = sample
    rows, raws, cells, corners = kept
    shape = values.shape
    nodes = values.reshape((-1, 4))
    along = np.uint64(shape[1] * shape[2]), np.uint64(shape[2]), np.uint64(1)
    most = 4 * (shape[0] + shape[1] + shape[2])
    light, index, found = np.float32(1.0), 0, 0
    while index < samples and light > DARK and found < most:
        distance = locate(index, enter, step, start, slope, shape, cell, fraction)
        i, j, k = cell[0], cell[1], cell[2]
        side = empty_side(parts, i, j, k)
        if side > 0:
            leave = np.float32(np.inf)
            for axis in range(3):
                leave = min(leave, cube_exit(start[axis], slope[axis], cell[axis], side))
            index += max(1, int((leave - distance) / step) + 1)
            continue
        index += 1
        weights = corners[found]
        corner_weights(fraction[0], fraction[1], fraction[2], weights)
        first = np.uint64((i * shape[1] + j) * shape[2] + k)
        raw = mixed(nodes, 0, first, along, weights)
        if raw < NEGLIGIBLE_RAW:
            continue
        stopped = between_entries(table, raw, 0)
        if stopped < FAINT:
            continue
        light = keep(nodes, first, along, weights, (light, stopped), rows[found])
        raws[found], cells[found, 0], cells[found, 1], cells[found, 2] = raw, i, j, k
        found += 1
    return found, light


@kernel()
def keep_shells(outer_values, march, passed, sample, kept):
    """Keep what a ray meets in the shells of the surroundings, behind what it `passed` in the box, as `keep_in_box`.

    `march` = (start, slope, jitter, shape of the inner grid).
    """
    start, slope, jitter, shape = march
    cell, fraction = sample
    rows, raws, cells, corners = kept
    nodes_along = outer_values.shape[0]
    shells = shell_count(nodes_along)
    nodes = outer_values.reshape((-1, 4))
    along = np.uint64(nodes_along * nodes_along), np.uint64(nodes_along), np.uint64(1)
    found, light = passed
    for shell in range(shells):
        if light <= STOPPED:
            break
        position = np.float32(shell) + np.float32(0.98) * jitter
        if cross_shell(position, nodes_along, start, slope, shape, cell, fraction) < np.float32(0.0):
            continue
        weights = corners[found]
        corner_weights(fraction[0], fraction[1], fraction[2], weights)
        first = np.uint64((cell[0] * nodes_along + cell[1]) * nodes_along + cell[2])
        raw, stopped = mixed(nodes, 0, first, along, weights), np.float32(1.0)
        if shell + 1 < shells:
            stopped = np.float32(1.0) - np.float32(math.exp(-RAW_TO_DEPTH * softplus(raw)))
        light = keep(nodes, first, along, weights, (light, stopped), rows[found])
        # the last shell is opaque, whatever its raw density
        raws[found] = raw if shell + 1 < shells else _OPAQUE_RAW
        cells[found, 0], cells[found, 1], cells[found, 2] = cell[0], cell[1], cell[2]
        found += 1
    return found, light


@kernel()
def color_error(rows, found, light, background, target, pull):
    """Squared colour error of a ray; fills `pull` (3) with g = dL/dC, and returns T_end b . g besides."""
    error = behind = np.float32(0.0)
    for channel in range(3):
        difference = light * background[channel] - target[channel]
        for index in range(found):
            difference += rows[index, 3] * rows[index, channel]
        error += difference * difference
        pull[channel] = np.float32(2.0) * difference
        behind += light * background[channel] * pull[channel]
    return error, behind


@kernel()
def sample_gradient(row, pull, behind, by_value):
    """Fill colours' part of a sample's gradient (4), and dL/do in place of that of its raw density.

    `behind` is what of C . g comes from behind it; returns that with the sample.
    """
    along = row[0] * pull[0] + row[1] * pull[1] + row[2] * pull[2]
    by_value[0] = row[4] * along - behind
    for channel in range(3):
        by_value[channel + 1] = row[3] * pull[channel]
    return behind + row[3] * along


@kernel(parallel=True)
def loss_and_gradient(grid, rays, scales, background, inner, outer):
    """Summed squared colour error of rays; adds its derivative to gradients[t] and marks touched[t] of thread t.

    `grid` = (values, parts, lower, per_meter), see learn.py; `rays` = (origins, directions, jitter, targets), of which
    jitter (n) moves all samples of a ray by a share of a step, from -0.5 to 0.5; `scales` = (step, sparsity, table),
    see `depth_table`. `inner` = (slots, gradients, touched) of the box, `outer` = (values, slots, gradients, touched)
    of the surroundings, whose values have the shape (0, 0, 0, 4) where there are none. Per-ray errors (n) are returned.
    `sparsity` weighs what drives fog away: it counts in the gradient, not in the errors.
    """
    origins, directions, jitter, targets = rays
    step, sparsity, table = scales
    slots, gradients, touched = inner
    around, outer_slots, outer_gradients, outer_touched = outer
    count, workers, shape = origins.shape[0], gradients.shape[0], grid[0].shape
    longest = 4 * (shape[0] + shape[1] + shape[2]) + shell_count(around.shape[0])
    errors = np.zeros(count, np.float32)
    for worker in prange(workers):
        start, slope = np.empty(3, np.float32), np.empty(3, np.float32)
        sample = np.empty(3, np.int64), np.empty(3, np.float32)
        rows, raws = np.empty((longest, 5), np.float32), np.empty(longest, np.float32)
        cells, corners = np.empty((longest, 3), np.int64), np.empty((longest, 8), np.float32)
        kept = rows, raws, cells, corners
        pull, by_value = np.empty(3, np.float32), np.empty(4, np.float32)
        for ray in range(worker * count // workers, (worker + 1) * count // workers):
            enter, leave = grid_ray(origins[ray], directions[ray], grid[2], grid[3], shape, start, slope)
            march = start, slope, enter + jitter[ray] * step, sample_count(enter, leave, step), step
            inside, light = keep_in_box(grid, march, table, sample, kept)
            found, light = keep_shells(around, (start, slope, jitter[ray], shape), (inside, light), sample, kept)
            errors[ray], behind = color_error(rows, found, light, background, targets[ray], pull)
            for index in range(found - 1, -1, -1):
                raw, cell, weights = raws[index], cells[index], corners[index]
                behind = sample_gradient(rows[index], pull, behind, by_value)
                if index < inside:
                    by_value[0] *= between_entries(table, raw, 1)
                    by_value[0] += sparsity * between_entries(table, raw, 2)
                    scatter(gradients[worker], touched[worker], slots, cell, weights, by_value)
                else:
                    by_value[0] *= RAW_TO_DEPTH * sigmoid(raw)
                    scatter(outer_gradients[worker], outer_touched[worker], outer_slots, cell, weights, by_value)
    return errors


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


@kernel()
def band(enter, leave, distance, reach, step):
    """The first sample of a ray in the band around a point, and the first behind it or the box."""
    most = int((leave - enter) / step)
    first = min(most, max(0, int(np.floor((distance - reach - enter) / step))))
    return first, min(most, int(np.ceil((distance + reach - enter) / step)))
