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
from nerfnav.field.kernels.cells import NEGLIGIBLE_RAW, cell_of
from nerfnav.field.kernels.march import STOPPED
from nerfnav.field.kernels.ray_sums import add_sample, values_and_slopes
from nerfnav.field.kernels.shells import RAW_TO_DEPTH, shell_count

_OPAQUE_RAW = np.float32(1e3)
_LEAST_SLOPE = np.float32(1e-9)


@kernel()
def add_shells(outer, ray, begin, light, first, sums):
    """Add all shells that a ray leaves behind the distance `begin` [m], seen through `light`, to its `sums`.

    `ray` is (start, slope, direction, shape, per_meter) of a ray in the inner grid, `first` the distance of the first
    density on it, 0 where there was none. Returns the light that is left, and `first`, which is then that of
    the shell before the first one with any density.
    """
    start, slope, direction, shape, per_meter = ray
    zero, one, two = np.float32(0.0), np.float32(1.0), np.float32(2.0)
    nodes = outer.shape[0]
    shells, to_grid = shell_count(nodes), np.float32(0.25) * np.float32(nodes - 1)
    at, along, inverse = np.empty(3, np.float32), np.empty(3, np.float32), np.empty(3, np.float32)
    halves, scale, mixed = np.empty(3, np.float32), np.empty(3, np.float32), np.empty((4, 4), np.float32)
    for axis in range(3):
        per_half = two / np.float32(shape[axis] - 1)
        halves[axis] = per_half * per_meter[axis]
        at[axis], along[axis] = per_half * start[axis] - one, per_half * slope[axis]
        if abs(along[axis]) < _LEAST_SLOPE:
            along[axis] = _LEAST_SLOPE
        inverse[axis] = one / along[axis]
    cell, fraction = np.empty(3, np.int64), np.empty(3, np.float32)
    before = zero
    for shell in range(shells):
        size = np.float32(shells) / (np.float32(shells - shell) - np.float32(0.5))
        distance, face = _leaves(size, at, along, inverse)
        if distance < begin:
            continue
        radius = (two - one / size) / size
        for axis in range(3):
            contracted = radius * (at[axis] + distance * along[axis])
            cell[axis], fraction[axis] = cell_of(to_grid * (contracted + two), nodes)
            scale[axis] = radius * to_grid * halves[axis]
        values_and_slopes(outer, (cell[0], cell[1], cell[2]), fraction, scale, mixed)
        if shell + 1 == shells:
            mixed[0, 0], mixed[0, 1], mixed[0, 2], mixed[0, 3] = _OPAQUE_RAW, zero, zero, zero
        if mixed[0, 0] >= NEGLIGIBLE_RAW:
            first = before if first == zero else first
            _along_face(mixed, direction, face)
            light = add_sample(mixed, RAW_TO_DEPTH, one, distance, light, sums)
        if light < STOPPED:
            break
        before = distance
    return light, first


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
def _along_face(mixed, direction, face):
    """Make gradients in space (channels, 4) those of what is seen on a face that stays where it is."""
    for channel in range(4):
        steep = np.float32(0.0)
        for axis in range(3):
            steep += mixed[channel, 1 + axis] * direction[axis]
        mixed[channel, 1 + face] -= steep / direction[face]
