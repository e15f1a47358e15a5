"""Ray marching through the grid: colour, opacity and depth, or the list of samples that matter.

Twin of field/render/volume_rendering.py with the samples of `uniform_samples`: sample i of a ray lies at
enter + (i + 0.5) step. A ray ends once less than `STOPPED` of its light is left.
"""

import math

import numpy as np

from nerfnav.core.jit import kernel, prange
from nerfnav.field.core.protocol import LAST_SAMPLE as _LAST_SAMPLE
from nerfnav.field.kernels.cells import (
    BLOCK_SHIFT,
    NEGLIGIBLE_RAW,
    cell_of,
    corner_weights,
    cube_exit,
    interpolate,
    node_counts,
    part_of,
    slab,
    softplus,
)
from nerfnav.field.kernels.light import STOPPED
from nerfnav.field.kernels.shells import see_shells

LAST_SAMPLE = np.float32(_LAST_SAMPLE)
CHUNK = 64
"""Rays that share one set of scratch arrays."""


@kernel()
def grid_ray(origin, direction, lower, per_meter, shape, start, slope):
    """A ray in grid coordinates, g(t) = start + t slope, and the interval of t inside the grid."""
    enter, leave = np.float32(0.0), np.float32(np.inf)
    for axis in range(3):
        start[axis] = (origin[axis] - lower[axis]) * per_meter[axis]
        slope[axis] = direction[axis] * per_meter[axis]
        enter, leave = slab(start[axis], slope[axis], shape[axis], enter, leave)
    return enter, leave


@kernel()
def next_sample(index, enter, step, start, slope, cell, occupied):
    """`index` itself where its cell lies in an occupied block, else the first sample beyond the empty block."""
    if occupied[cell[0] >> BLOCK_SHIFT, cell[1] >> BLOCK_SHIFT, cell[2] >> BLOCK_SHIFT]:
        return index
    distance = enter + (np.float32(index) + np.float32(0.5)) * step
    leave = np.float32(np.inf)
    for axis in range(3):
        leave = min(leave, cube_exit(start[axis], slope[axis], cell[axis], BLOCK_SHIFT))
    return index + max(1, int((leave - distance) / step) + 1)


@kernel()
def locate(index, enter, step, start, slope, shape, cell, fraction):
    """Cell and fraction of sample `index` of a ray; returns its distance from the origin."""
    distance = enter + (np.float32(index) + np.float32(0.5)) * step
    for axis in range(3):
        cell[axis], fraction[axis] = cell_of(start[axis] + distance * slope[axis], shape[axis])
    return distance


@kernel()
def sample_count(enter, leave, step):
    """Number of samples of a ray inside the grid: the middle of the last one is still inside."""
    return max(0, int((leave - enter) / step + LAST_SAMPLE))


@kernel()
def scratch():
    """Arrays that the march of one ray writes to: start, slope, cell, fraction, weights."""
    return (
        np.empty(3, np.float32),
        np.empty(3, np.float32),
        np.empty(3, np.int64),
        np.empty(3, np.float32),
        np.empty(8, np.float32),
    )


@kernel(parallel=True)
def render(values, occupied, lower, per_meter, origins, directions, scale, step, background, outer):
    """Colour (n, 3), opacity (n) and mean depth (n) of rays; `outer` are the `Shells` around (kernels/shells.py)."""
    count = origins.shape[0]
    shape = node_counts(values, lower)
    colors = np.empty((count, 3), np.float32)
    opacities, depths = np.empty(count, np.float32), np.empty(count, np.float32)
    for chunk in prange((count + CHUNK - 1) // CHUNK):
        start, slope, cell, fraction, weights = scratch()
        seen = np.empty(4, np.float32)
        for ray in range(chunk * CHUNK, min(count, (chunk + 1) * CHUNK)):
            enter, leave = grid_ray(origins[ray], directions[ray], lower, per_meter, shape, start, slope)
            samples = sample_count(enter, leave, step)
            red = green = blue = depth = np.float32(0.0)
            light, index = np.float32(1.0), 0
            while index < samples and light > STOPPED:
                distance = locate(index, enter, step, start, slope, shape, cell, fraction)
                following = next_sample(index, enter, step, start, slope, cell, occupied)
                if following > index:
                    index = following
                    continue
                index += 1
                part, i, j, k = part_of(values, occupied, cell[0], cell[1], cell[2])
                corner_weights(fraction[0], fraction[1], fraction[2], weights)
                raw = interpolate(part, 0, i, j, k, weights)
                if raw < NEGLIGIBLE_RAW:
                    continue
                through = np.float32(math.exp(-scale * softplus(raw) * step))
                weight = light * (np.float32(1.0) - through)
                red += weight * interpolate(part, 1, i, j, k, weights)
                green += weight * interpolate(part, 2, i, j, k, weights)
                blue += weight * interpolate(part, 3, i, j, k, weights)
                depth += weight * distance
                light *= through
            seen[0], seen[1], seen[2], seen[3] = red, green, blue, depth
            if outer[0].shape[0] > 0 and light > STOPPED:
                light = see_shells(outer, start, slope, shape, light, (cell, fraction, weights), seen)
            for channel in range(3):
                colors[ray, channel] = seen[channel] + light * background[channel]
            opacities[ray] = np.float32(1.0) - light
            depths[ray] = seen[3] / max(np.float32(1.0) - light, np.float32(1e-6))
    return colors, opacities, depths


@kernel(parallel=True)
def significant_samples(values, occupied, lower, per_meter, origins, directions, scale, step, least, capacity):
    """Distances (n, capacity) of the samples with density above `least` [1/m], and how many each ray has.

    A ray with more of them than `capacity` reports its true count, so that the caller can ask again.
    """
    count = origins.shape[0]
    shape = node_counts(values, lower)
    distances = np.zeros((count, capacity), np.float32)
    counts = np.zeros(count, np.int64)
    for chunk in prange((count + CHUNK - 1) // CHUNK):
        start, slope, cell, fraction, weights = scratch()
        for ray in range(chunk * CHUNK, min(count, (chunk + 1) * CHUNK)):
            enter, leave = grid_ray(origins[ray], directions[ray], lower, per_meter, shape, start, slope)
            samples = sample_count(enter, leave, step)
            light = np.float32(1.0)
            index, found = 0, 0
            while index < samples and light > STOPPED:
                distance = locate(index, enter, step, start, slope, shape, cell, fraction)
                following = next_sample(index, enter, step, start, slope, cell, occupied)
                if following > index:
                    index = following
                    continue
                index += 1
                part, i, j, k = part_of(values, occupied, cell[0], cell[1], cell[2])
                corner_weights(fraction[0], fraction[1], fraction[2], weights)
                density = scale * softplus(interpolate(part, 0, i, j, k, weights))
                if density < least:
                    continue
                if found < capacity:
                    distances[ray, found] = distance
                found += 1
                light *= np.float32(math.exp(-density * step))
            counts[ray] = found
    return distances, counts
