"""Carving kernels: the colours that each node may have, by all pictures that look through it, and the reach of light.

For each node and channel, the two largest of the windows' smallest colours and the two smallest of their largest ones
are kept: where even the second ones contradict each other, no one picture that is wrong has made them do so.
"""

import math

import numpy as np

from nerfnav.core.jit import kernel, prange
from nerfnav.field.kernels.cells import NEGLIGIBLE_RAW, corner_weights, interpolate, node_counts, part_of, softplus
from nerfnav.field.kernels.march import CHUNK, grid_ray, locate, next_sample, sample_count, scratch
from nerfnav.field.kernels.views import SIDE, cube_count, cube_in_view, in_camera, picture_of, position_of, window_of

MOST = 255
"""Counting ends here."""


@kernel(parallel=True)
def reaches(values, occupied, lower, per_meter, origins, directions, scale, step, least_light):
    """Distance [m] (n) at which rays have less than `least_light` of their light left; infinite where they never do."""
    count, shape = origins.shape[0], node_counts(values, lower)
    distances = np.full(count, np.inf, np.float32)
    for chunk in prange((count + CHUNK - 1) // CHUNK):
        start, slope, cell, fraction, weights = scratch()
        for ray in range(chunk * CHUNK, min(count, (chunk + 1) * CHUNK)):
            enter, leave = grid_ray(origins[ray], directions[ray], lower, per_meter, shape, start, slope)
            samples = sample_count(enter, leave, step)
            light = np.float32(1.0)
            index = 0
            while index < samples:
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
                light *= np.float32(math.exp(-scale * softplus(raw) * step))
                if light < least_light:
                    distances[ray] = distance
                    break
    return distances


@kernel(parallel=True)
def look_through(grid, view, maps, sizes, background, sums):
    """Add to `sums` what one picture says of each node that it looks through.

    `grid` = (lower, spacing, how far windows reach from a node [m]), `view` = (rotation, position, lens), `maps` =
    (reach (levels, h, w), least, most (levels, h, w, 3)): the shortest reach of rays [m] and the smallest and largest
    colours, 0 to 255, within windows of `sizes` pixels that begin at each pixel. `background` (2, 3) are the smallest
    and largest colours that count as that of nothing.
    `sums` = (asked, clear (nx, ny, nz): whether a node is asked about, and pictures that see nothing there but the
    background; kept (nx, ny, nz, 3, 4) uint8: for each channel the largest and second largest of the smallest colours,
    the smallest and second smallest of the largest).
    """
    lower, spacing, beside = grid
    rotation, position, lens = view
    (reach, least, most), (asked, clear, kept) = maps, sums
    shape, height, width = asked.shape, reach.shape[1], reach.shape[2]
    for cube in prange(cube_count(shape)):
        x0, y0, z0, seen = cube_in_view(cube, lower, spacing, shape, view, width, height)
        if not seen:
            continue
        for i in range(x0, min(x0 + SIDE, shape[0])):
            for j in range(y0, min(y0 + SIDE, shape[1])):
                for k in range(z0, min(z0 + SIDE, shape[2])):
                    if not asked[i, j, k]:
                        continue
                    x, y, z = position_of(i, j, k, lower, spacing)
                    right, down, ahead = in_camera(x, y, z, rotation, position)
                    if ahead <= np.float32(1e-9):
                        continue
                    place = picture_of(right, down, ahead, lens)
                    level, u, v = window_of(place[0], place[1], beside * lens[0] / ahead, sizes, width, height)
                    away = np.float32(math.sqrt(right * right + down * down + ahead * ahead))
                    if level < 0 or reach[level, v, u] < away:
                        continue
                    nothing = reach[level, v, u] == np.float32(np.inf)
                    for channel in range(3):
                        darkest, brightest = least[level, v, u, channel], most[level, v, u, channel]
                        nothing = nothing and darkest >= background[0, channel]
                        nothing = nothing and brightest <= background[1, channel]
                        keep(kept[i, j, k, channel], darkest, brightest)
                    if nothing:
                        clear[i, j, k] = min(clear[i, j, k] + 1, MOST)


@kernel(inline=True)
def keep(kept, darkest, brightest):
    """Note a window's colours among the two most contradictory ones."""
    if darkest > kept[0]:
        kept[0], kept[1] = darkest, kept[0]
    elif darkest > kept[1]:
        kept[1] = darkest
    if brightest < kept[2]:
        kept[2], kept[3] = brightest, kept[2]
    elif brightest < kept[3]:
        kept[3] = brightest
