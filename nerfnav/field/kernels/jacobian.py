"""Jacobian kernels: colours of rays through grid and shells, and their derivatives by the camera's pose.

Twin of differentiating `render_rays`; dense grids have a quicker kernel, kernels/pose_descent.py. Notation as in
field/render/volume_rendering.py, with o_i = rho_i step and p_i = origin + t_i direction. The light behind sample i is
T_i+1 = T_i exp(-o_i), and what it shines on is C - P_i, with P_i = sum_{j<=i} T_j alpha_j c_j. Then

    dC = sum_i [ (T_i+1 c_i + P_i - C) grad o_i' + T_i alpha_i grad c_i' ] dp_i
    dp_i = d(centre) + d(turn) x t_i direction

for a camera whose centre moves by d(centre) [m] and that turns by d(turn) [rad] about its centre, both in the world's
axes. One march is enough: C leaves the sum, sum_i (P_i - C) grad o_i = sum_i P_i grad o_i - C sum_i grad o_i.

Shells (field/render/surroundings.py). A ray p(t) = o + t d leaves shell k through the face that it reaches first,
across axis a. That face stays where it is when the camera moves, so that t moves, and with F a colour or a raw
density, G = dF/dp its gradient in the world and dp_i = do + t dd the motion of a point at a fixed distance,

    dF = (G - (G . d) / d_a e_a) . dp_i

which has the form of a sample's inside the box: shells are added to the same sums.
"""

import math

import numpy as np

from nerfnav.core.jit import kernel, prange
from nerfnav.field.kernels.cells import NEGLIGIBLE_RAW, cell_of, node_counts, part_of, sigmoid, slopes_between, softplus
from nerfnav.field.kernels.light import STOPPED, column_at, entry_at
from nerfnav.field.kernels.march import CHUNK, grid_ray, locate, next_sample, sample_count, scratch
from nerfnav.field.kernels.shells import middle_of, shell_count


@kernel()
def values_and_slopes(values, cell, fraction, per_meter, mixed):
    """Fill `mixed` (channels, 4): value and gradient [1/m] of each channel between the 8 corners of a cell."""
    one = np.float32(1.0)
    i, j, k = cell
    x, y, z = fraction[0], fraction[1], fraction[2]
    for channel in range(4):
        near00, far00 = values[i, j, k, channel], values[i, j, k + 1, channel]
        near01, far01 = values[i, j + 1, k, channel], values[i, j + 1, k + 1, channel]
        near10, far10 = values[i + 1, j, k, channel], values[i + 1, j, k + 1, channel]
        near11, far11 = values[i + 1, j + 1, k, channel], values[i + 1, j + 1, k + 1, channel]
        edge00, edge01 = near00 + z * (far00 - near00), near01 + z * (far01 - near01)
        edge10, edge11 = near10 + z * (far10 - near10), near11 + z * (far11 - near11)
        face0, face1 = edge00 + y * (edge01 - edge00), edge10 + y * (edge11 - edge10)
        mixed[channel, 0] = face0 + x * (face1 - face0)
        mixed[channel, 1] = per_meter[0] * (face1 - face0)
        mixed[channel, 2] = per_meter[1] * ((one - x) * (edge01 - edge00) + x * (edge11 - edge10))
        along0 = (one - y) * (far00 - near00) + y * (far01 - near01)
        along1 = (one - y) * (far10 - near10) + y * (far11 - near11)
        mixed[channel, 3] = per_meter[2] * ((one - x) * along0 + x * along1)


@kernel()
def add_sample(mixed, scale, step, distance, light, sums):
    """Add one sample to the sums of its ray; returns the light behind it.

    `sums` (4, 7): in the rows of the three channels P, the sum of all but C's share of dC / dp_i, and that sum weighted
    by t_i; in the last row, from its second number on, the sums of grad o_i and t_i grad o_i.
    """
    through = np.float32(math.exp(-scale * softplus(mixed[0, 0]) * step))
    weight, behind = light * (np.float32(1.0) - through), light * through
    slope = scale * step * sigmoid(mixed[0, 0])
    for channel in range(3):
        color = mixed[1 + channel, 0]
        sums[channel, 0] += weight * color
        pull = slope * (behind * color + sums[channel, 0])
        for axis in range(3):
            part = pull * mixed[0, 1 + axis] + weight * mixed[1 + channel, 1 + axis]
            sums[channel, 1 + axis] += part
            sums[channel, 4 + axis] += distance * part
    for axis in range(3):
        part = slope * mixed[0, 1 + axis]
        sums[3, 1 + axis] += part
        sums[3, 4 + axis] += distance * part
    return behind


@kernel()
def finish_ray(sums, light, background, direction, color, jacobian):
    """Fill colour (3) and Jacobian (3, 6) of a ray from its sums and the light that is left."""
    x, y, z = direction[0], direction[1], direction[2]
    for channel in range(3):
        total = sums[channel, 0] + light * background[channel]
        color[channel] = total
        for axis in range(3):
            jacobian[channel, axis] = sums[channel, 1 + axis] - total * sums[3, 1 + axis]
        along_x = sums[channel, 4] - total * sums[3, 4]
        along_y = sums[channel, 5] - total * sums[3, 5]
        along_z = sums[channel, 6] - total * sums[3, 6]
        jacobian[channel, 3] = y * along_z - z * along_y
        jacobian[channel, 4] = z * along_x - x * along_z
        jacobian[channel, 5] = x * along_y - y * along_x


_LEAST_SLOPE = np.float32(1e-9)


@kernel()
def add_shells(outer, ray, begin, light, first, sums):
    """Add all shells that a ray leaves behind the distance `begin` [m], seen through `light`, to its `sums`.

    `outer` are `Shells`; `ray` is (start, slope, direction, shape, per_meter) of a ray in the inner grid, `first` the
    distance of the first density on it, 0 where there was none. Returns the light that is left, and `first`, which is
    then that of the shell before the first one with any density.
    """
    values, table, at_once, least, stopped = outer
    start, slope, direction, shape, per_meter = ray
    zero, one, two = np.float32(0.0), np.float32(1.0), np.float32(2.0)
    nodes = values.shape[0]
    shells, to_grid = shell_count(nodes), np.float32(0.25) * np.float32(nodes - 1)
    at, along, inverse = np.empty(3, np.float32), np.empty(3, np.float32), np.empty(3, np.float32)
    halves, scale = np.empty(3, np.float32), np.empty(3, np.float32)
    for axis in range(3):
        per_half = two / np.float32(shape[axis] - 1)
        halves[axis] = per_half * per_meter[axis]
        at[axis], along[axis] = per_half * start[axis] - one, per_half * slope[axis]
        if abs(along[axis]) < _LEAST_SLOPE:
            along[axis] = _LEAST_SLOPE
        inverse[axis] = one / along[axis]
    cell, fraction = np.empty(3, np.int64), np.empty(3, np.float32)
    before, begin = zero, max(begin, zero)
    for shell in range(0, shells, at_once):
        size = np.float32(shells) / (np.float32(shells) - middle_of(shell, at_once, shells) - np.float32(0.5))
        distance, face = _leaves(size, at, along, inverse)
        if distance < begin:
            continue
        radius = (two - one / size) / size
        for axis in range(3):
            contracted = radius * (at[axis] + distance * along[axis])
            cell[axis], fraction[axis] = cell_of(to_grid * (contracted + two), nodes)
            scale[axis] = radius * to_grid * halves[axis]
        place = (cell[0], cell[1], cell[2], fraction[0], fraction[1], fraction[2])
        raw, rx, ry, rz = slopes_between(values, 0, *place)
        last = shell + at_once >= shells
        if last or raw >= least:
            first = before if first == zero else first
            sample = (light, distance, zero, zero)
            if not last:
                found = entry_at(table, raw)
                sample = (light, distance, column_at(table, found, 0), column_at(table, found, 1))
            _add(values, place, (rx, ry, rz), (scale, direction, face), sample, sums)
            light *= sample[2]
        if light < stopped:
            break
        before = distance
    return light, first


@kernel()
def _add(values, place, by_place, seen, sample, sums):
    """Add a shell to the sums, as `add_sample` does.

    `by_place` is the gradient of the raw density [1 / node], `seen` (nodes per metre, direction, axis of the face),
    `sample` (light before it, distance, share that passes, do / draw).
    """
    light, distance, through, by_raw = sample
    weight, behind = light * (np.float32(1.0) - through), light * through
    dx, dy, dz = _along_face(by_place, seen)
    dx, dy, dz = by_raw * dx, by_raw * dy, by_raw * dz
    for channel in range(3):
        color, cx, cy, cz = slopes_between(values, channel + 1, *place)
        cx, cy, cz = _along_face((cx, cy, cz), seen)
        sums[channel, 0] += weight * color
        pull = behind * color + sums[channel, 0]
        _put(sums[channel], distance, pull * dx + weight * cx, pull * dy + weight * cy, pull * dz + weight * cz)
    _put(sums[3], distance, dx, dy, dz)


@kernel()
def _put(row, distance, x, y, z):
    """Add a slope to a row of sums, and that weighted by its distance."""
    row[1], row[2], row[3] = row[1] + x, row[2] + y, row[3] + z
    row[4], row[5], row[6] = row[4] + distance * x, row[5] + distance * y, row[6] + distance * z


@kernel()
def _leaves(size, at, along, inverse):
    """Distance [m] at which a ray leaves a box of `size` around the origin, -1 where it misses it; and the axis."""
    enter, leave, face = np.float32(0.0), np.float32(np.inf), 0
    for axis in range(3):
        ahead = size if along[axis] > np.float32(0.0) else -size
        enter = max(enter, (-ahead - at[axis]) * inverse[axis])
        far = (ahead - at[axis]) * inverse[axis]
        if far < leave:
            leave, face = far, axis
    return (leave if leave > enter else np.float32(-1.0)), face


@kernel()
def _along_face(slopes, seen):
    """The gradient in space [1 / node] of what is seen on a face that stays where it is [1/m]."""
    scale, direction, face = seen
    x, y, z = scale[0] * slopes[0], scale[1] * slopes[1], scale[2] * slopes[2]
    steep = (x * direction[0] + y * direction[1] + z * direction[2]) / direction[face]
    zero = np.float32(0.0)
    return x - (steep if face == 0 else zero), y - (steep if face == 1 else zero), z - (steep if face == 2 else zero)


@kernel(parallel=True)
def colors_and_jacobian(values, occupied, lower, per_meter, origins, directions, scale, step, background, outer):
    """Colours (n, 3) of rays and their derivatives (n, 3, 6) by d(centre) [1/m] and d(turn) [1/rad].

    `outer` are the `Shells` around (see kernels/shells.py).
    """
    count = origins.shape[0]
    shape = node_counts(values, lower)
    colors = np.empty((count, 3), np.float32)
    jacobians = np.empty((count, 3, 6), np.float32)
    for chunk in prange((count + CHUNK - 1) // CHUNK):
        start, slope, cell, fraction, _ = scratch()
        mixed, sums = np.empty((4, 4), np.float32), np.empty((4, 7), np.float32)
        for ray in range(chunk * CHUNK, min(count, (chunk + 1) * CHUNK)):
            enter, leave = grid_ray(origins[ray], directions[ray], lower, per_meter, shape, start, slope)
            samples = sample_count(enter, leave, step)
            sums[:] = np.float32(0.0)
            light = np.float32(1.0)
            index = 0
            while index < samples and light > STOPPED:
                distance = locate(index, enter, step, start, slope, shape, cell, fraction)
                following = next_sample(index, enter, step, start, slope, cell, occupied)
                if following > index:
                    index = following
                    continue
                index += 1
                part, i, j, k = part_of(values, occupied, cell[0], cell[1], cell[2])
                values_and_slopes(part, (i, j, k), fraction, per_meter, mixed)
                if mixed[0, 0] >= NEGLIGIBLE_RAW:
                    light = add_sample(mixed, scale, step, distance, light, sums)
            if outer[0].shape[0] > 0 and light > STOPPED:
                through = (start, slope, directions[ray], shape, per_meter)
                light, _ = add_shells(outer, through, np.float32(0.0), light, np.float32(0.0), sums)
            finish_ray(sums, light, background, directions[ray], colors[ray], jacobians[ray])
    return colors, jacobians
