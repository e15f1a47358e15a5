"""Colours of rays and their derivatives by the camera's pose: twin of differentiating `render_rays`.

The equations are those of kernels/ray_sums.py; here the sums of a ray are numbers, which is quicker than arrays.

exp(-o) and do/draw are functions of the raw density alone, and come from a table: three transcendental functions would
take longer than all the rest. Empty cells are leapt over (leaps.py).
"""

import numpy as np

from nerfnav.compiled import kernel, prange
from nerfnav.field.kernels.cells import NEGLIGIBLE_RAW
from nerfnav.field.kernels.march import CHUNK, STOPPED, grid_ray, sample_count
from nerfnav.field.kernels.ray_sums import finish_ray
from nerfnav.field.kernels.shell_slopes import add_shells

PER_RAW, HIGHEST_RAW = 32, 16
"""Entries of the table for each unit of raw density, and where it ends."""


def light_table(scale: float, step: float) -> np.ndarray:
    """exp(-o) and do/draw (entries, 2) of samples that stand for `step` [m], by raw density from NEGLIGIBLE_RAW on.

    Between entries both are linear to about 1e-4 of what a sample stops.
    """
    raw = float(NEGLIGIBLE_RAW) + np.arange((HIGHEST_RAW - int(NEGLIGIBLE_RAW)) * PER_RAW + 1) / PER_RAW
    depth, slope = scale * step * np.logaddexp(0.0, raw), scale * step / (1.0 + np.exp(-raw))
    return np.stack([np.exp(-depth), slope], -1).astype(np.float32)


@kernel(inline=True)
def slopes_between(values, channel, i, j, k, x, y, z):
    """Value of a channel at a fraction (x, y, z) of a cell, and its gradient [1 / node]."""
    one = np.float32(1.0)
    near00, far00 = values[i, j, k, channel], values[i, j, k + 1, channel]
    near01, far01 = values[i, j + 1, k, channel], values[i, j + 1, k + 1, channel]
    near10, far10 = values[i + 1, j, k, channel], values[i + 1, j, k + 1, channel]
    near11, far11 = values[i + 1, j + 1, k, channel], values[i + 1, j + 1, k + 1, channel]
    edge00, edge01 = near00 + z * (far00 - near00), near01 + z * (far01 - near01)
    edge10, edge11 = near10 + z * (far10 - near10), near11 + z * (far11 - near11)
    face0, face1 = edge00 + y * (edge01 - edge00), edge10 + y * (edge11 - edge10)
    by_y = (one - x) * (edge01 - edge00) + x * (edge11 - edge10)
    along0 = (one - y) * (far00 - near00) + y * (far01 - near01)
    along1 = (one - y) * (far10 - near10) + y * (far11 - near11)
    return face0 + x * (face1 - face0), face1 - face0, by_y, (one - x) * along0 + x * along1


@kernel(inline=True)
def leap(index, leaps, cell, start, slope, at):
    """First sample beyond the cells that are known to be empty around `cell`; `at` is (distance, step) of this one."""
    leave = np.float32(np.inf)
    for axis in range(3):
        border = cell[axis] + leaps if slope[axis] > np.float32(0.0) else cell[axis] - leaps + 1
        if abs(slope[axis]) > np.float32(1e-9):
            leave = min(leave, (np.float32(border) - start[axis]) / slope[axis])
    return index + max(1, int((leave - at[0]) / at[1]) + 1)


@kernel(inline=True)
def see_ray(grid, origin, direction, begin, color, jacobian):
    """Fill colour (3) and Jacobian (3, 6) of a ray; returns the distance of the first density on it, 0 where
    it meets none (around the box: of the shell before).

    `grid` is (values, leaps, lower, per_meter, table, step, background, outer), see `VoxelField.sight_grid`. Before the
    distance `begin` [m] the ray is taken as clear.
    """
    values, leaps, lower, per_meter, table, step, background, outer = grid
    zero, one, half = np.float32(0.0), np.float32(1.0), np.float32(0.5)
    shape = values.shape
    start, slope, cell = np.empty(3, np.float32), np.empty(3, np.float32), np.empty(3, np.int64)
    enter, leave = grid_ray(origin, direction, lower, per_meter, shape, start, slope)
    samples = sample_count(enter, leave, step)
    index = max(0, int((begin - enter) / step))
    scale_x, scale_y, scale_z = per_meter[0], per_meter[1], per_meter[2]
    light, first = one, zero
    seen0 = seen1 = seen2 = zero
    a0x = a0y = a0z = a1x = a1y = a1z = a2x = a2y = a2z = zero  # dC / dp but for C's share, of each channel
    b0x = b0y = b0z = b1x = b1y = b1z = b2x = b2y = b2z = zero  # the same weighted by distance
    gx = gy = gz = hx = hy = hz = zero  # sums of grad o, and of these weighted by distance
    while index < samples and light > STOPPED:
        t = enter + (np.float32(index) + half) * step
        x = min(max(start[0] + t * slope[0], zero), np.float32(shape[0] - 1))
        y = min(max(start[1] + t * slope[1], zero), np.float32(shape[1] - 1))
        z = min(max(start[2] + t * slope[2], zero), np.float32(shape[2] - 1))
        i, j, k = min(int(x), shape[0] - 2), min(int(y), shape[1] - 2), min(int(z), shape[2] - 2)
        if leaps[i, j, k] > 0:
            cell[0], cell[1], cell[2] = i, j, k
            index = leap(index, leaps[i, j, k], cell, start, slope, (t, step))
            continue
        index += 1
        x, y, z = x - np.float32(i), y - np.float32(j), z - np.float32(k)
        raw, rx, ry, rz = slopes_between(values, 0, i, j, k, x, y, z)
        if raw < NEGLIGIBLE_RAW:
            continue
        if first == zero:
            first = t
        place = min((raw - NEGLIGIBLE_RAW) * np.float32(PER_RAW), np.float32(table.shape[0]) - np.float32(1.001))
        entry = int(place)
        between = place - np.float32(entry)
        through = table[entry, 0] + between * (table[entry + 1, 0] - table[entry, 0])
        by_raw = table[entry, 1] + between * (table[entry + 1, 1] - table[entry, 1])
        weight = light * (one - through)
        light *= through
        rx, ry, rz = by_raw * scale_x * rx, by_raw * scale_y * ry, by_raw * scale_z * rz
        gx, gy, gz, hx, hy, hz = gx + rx, gy + ry, gz + rz, hx + t * rx, hy + t * ry, hz + t * rz
        wx, wy, wz = weight * scale_x, weight * scale_y, weight * scale_z
        c, ux, uy, uz = slopes_between(values, 1, i, j, k, x, y, z)
        seen0 += weight * c
        pull = light * c + seen0
        ux, uy, uz = pull * rx + wx * ux, pull * ry + wy * uy, pull * rz + wz * uz
        a0x, a0y, a0z, b0x, b0y, b0z = a0x + ux, a0y + uy, a0z + uz, b0x + t * ux, b0y + t * uy, b0z + t * uz
        c, ux, uy, uz = slopes_between(values, 2, i, j, k, x, y, z)
        seen1 += weight * c
        pull = light * c + seen1
        ux, uy, uz = pull * rx + wx * ux, pull * ry + wy * uy, pull * rz + wz * uz
        a1x, a1y, a1z, b1x, b1y, b1z = a1x + ux, a1y + uy, a1z + uz, b1x + t * ux, b1y + t * uy, b1z + t * uz
        c, ux, uy, uz = slopes_between(values, 3, i, j, k, x, y, z)
        seen2 += weight * c
        pull = light * c + seen2
        ux, uy, uz = pull * rx + wx * ux, pull * ry + wy * uy, pull * rz + wz * uz
        a2x, a2y, a2z, b2x, b2y, b2z = a2x + ux, a2y + uy, a2z + uz, b2x + t * ux, b2y + t * uy, b2z + t * uz
    sums = np.zeros((4, 7), np.float32)
    _keep(sums[0], seen0, (a0x, a0y, a0z, b0x, b0y, b0z))
    _keep(sums[1], seen1, (a1x, a1y, a1z, b1x, b1y, b1z))
    _keep(sums[2], seen2, (a2x, a2y, a2z, b2x, b2y, b2z))
    _keep(sums[3], zero, (gx, gy, gz, hx, hy, hz))
    if outer.shape[0] > 0 and light > STOPPED:
        light, first = add_shells(outer, (start, slope, direction, shape, per_meter), begin, light, first, sums)
    finish_ray(sums, light, background, direction, color, jacobian)
    return first


@kernel(inline=True)
def _keep(row, seen, slopes):
    """Fill a row of sums as `add_sample` has them."""
    row[0] = seen
    for index in range(6):
        row[1 + index] = slopes[index]


@kernel(parallel=True)
def colors_and_jacobian(grid, origins, directions):
    """Colours (n, 3) of rays and their derivatives (n, 3, 6) by d(centre) [1/m] and d(turn) [1/rad]."""
    count = origins.shape[0]
    colors = np.empty((count, 3), np.float32)
    jacobians = np.empty((count, 3, 6), np.float32)
    for chunk in prange((count + CHUNK - 1) // CHUNK):
        for ray in range(chunk * CHUNK, min(count, (chunk + 1) * CHUNK)):
            see_ray(grid, origins[ray], directions[ray], np.float32(0.0), colors[ray], jacobians[ray])
    return colors, jacobians
