"""What rays see, followed as descents of poses follow them: without what is faint, and with shells in pairs.

Twin of kernels/sight.py without the derivatives: colours are the same in half of the time, and depths come with them.
"""

import numpy as np

from nerfnav.compiled import kernel, prange
from nerfnav.field.kernels.cells import between
from nerfnav.field.kernels.light import column_at, entry_at
from nerfnav.field.kernels.march import CHUNK, grid_ray, sample_count
from nerfnav.field.kernels.shells import see_shells
from nerfnav.field.kernels.sight import invert, leap, ray_scratch


@kernel(inline=True)
def glance_scratch():
    """What `glance_along` writes to. Made once for many rays."""
    shells = np.empty(3, np.int64), np.empty(3, np.float32), np.empty(8, np.float32)
    return ray_scratch(), shells, np.empty(4, np.float32)


@kernel(inline=True)
def glance_along(grid, ray, color, scratch):
    """Fill the colour (3) of a ray (origin, direction); returns the light that is left, and the sum of the distances
    that it stopped at [m].

    `grid` as `see_ray` has it; `scratch` is that of `glance_scratch`.
    """
    values, leaps, lower, per_meter, table, step, background, outer, least, stopped = grid
    zero, one, half = np.float32(0.0), np.float32(1.0), np.float32(0.5)
    shape, ((start, slope, inverse, _), shells, seen) = values.shape, scratch
    enter, leave = grid_ray(ray[0], ray[1], lower, per_meter, shape, start, slope)
    invert(slope, inverse)
    samples, per_step, index, light = sample_count(enter, leave, step), one / step, 0, one
    red = green = blue = far = zero
    while index < samples and light > stopped:
        t = enter + (np.float32(index) + half) * step
        x = min(max(start[0] + t * slope[0], zero), np.float32(shape[0] - 1))
        y = min(max(start[1] + t * slope[1], zero), np.float32(shape[1] - 1))
        z = min(max(start[2] + t * slope[2], zero), np.float32(shape[2] - 1))
        i, j, k = min(int(x), shape[0] - 2), min(int(y), shape[1] - 2), min(int(z), shape[2] - 2)
        if leaps[i, j, k] > 0:
            index = leap(index, int(leaps[i, j, k]), (i, j, k), (start, slope, inverse), (t, per_step))
            continue
        index += 1
        x, y, z = x - np.float32(i), y - np.float32(j), z - np.float32(k)
        raw = between(values, 0, i, j, k, x, y, z)
        if raw < least:
            continue
        through = column_at(table, entry_at(table, raw), 0)
        weight = light * (one - through)
        light *= through
        red += weight * between(values, 1, i, j, k, x, y, z)
        green += weight * between(values, 2, i, j, k, x, y, z)
        blue += weight * between(values, 3, i, j, k, x, y, z)
        far += weight * t
    seen[0], seen[1], seen[2], seen[3] = red, green, blue, far
    if outer[0].shape[0] > 0 and light > stopped:
        light = see_shells(outer, start, slope, shape, light, shells, seen)
    for channel in range(3):
        color[channel] = seen[channel] + light * background[channel]
    return light, seen[3]


@kernel(parallel=True)
def glance(grid, origins, directions):
    """Colour (n, 3), opacity (n) and mean depth (n) of rays; `grid` is as `see_ray` has it."""
    count = origins.shape[0]
    colors = np.empty((count, 3), np.float32)
    opacities, depths = np.empty(count, np.float32), np.empty(count, np.float32)
    for chunk in prange((count + CHUNK - 1) // CHUNK):
        scratch = glance_scratch()
        for ray in range(chunk * CHUNK, min(count, (chunk + 1) * CHUNK)):
            light, far = glance_along(grid, (origins[ray], directions[ray]), colors[ray], scratch)
            opacities[ray] = np.float32(1.0) - light
            depths[ray] = far / max(np.float32(1.0) - light, np.float32(1e-6))
    return colors, opacities, depths
