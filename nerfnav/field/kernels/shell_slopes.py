"""Colours of the shells around the box and their derivatives by the camera's pose, for kernels that sum along rays.

Notation as in field/surroundings.py and kernels/ray_sums.py. A ray p(t) = o + t d leaves shell k through the face that
it reaches first, across axis a. That face stays where it is when the camera moves, so that t moves, and with
F a colour or a raw density, G = dF/dp its gradient in the world and dp_i = do + t dd the motion of a point at a fixed
distance,

    dF = (G - (G . d) / d_a e_a) . dp_i

which has the form of a sample's inside the box: shells are added to the same sums.
"""

import numpy as np

from nerfnav.compiled import kernel
from nerfnav.field.kernels.cells import cell_of, slopes_between
from nerfnav.field.kernels.light import column_at, entry_at
from nerfnav.field.kernels.shells import middle_of, shell_count

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


@kernel(inline=True)
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


@kernel(inline=True)
def _put(row, distance, x, y, z):
    """Add a slope to a row of sums, and that weighted by its distance."""
    row[1], row[2], row[3] = row[1] + x, row[2] + y, row[3] + z
    row[4], row[5], row[6] = row[4] + distance * x, row[5] + distance * y, row[6] + distance * z


@kernel(inline=True)
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


@kernel(inline=True)
def _along_face(slopes, seen):
    """The gradient in space [1 / node] of what is seen on a face that stays where it is [1/m]."""
    scale, direction, face = seen
    x, y, z = scale[0] * slopes[0], scale[1] * slopes[1], scale[2] * slopes[2]
    steep = (x * direction[0] + y * direction[1] + z * direction[2]) / direction[face]
    zero = np.float32(0.0)
    return x - (steep if face == 0 else zero), y - (steep if face == 1 else zero), z - (steep if face == 2 else zero)
