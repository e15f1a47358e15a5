"""Probe: colours that a camera on a body sees of a field, without derivatives, to compare many poses with a picture."""

import numpy as np

from nerfnav.core.jit import kernel
from nerfnav.field.kernels.pose_descent import probe_along, probe_scratch
from nerfnav.geometry.rotations import product


@kernel()
def center(rotation, position, mount, origin):
    """Fill where the camera is [m], mounted at `mount` on a body."""
    for axis in range(3):
        arm = rotation[axis, 0] * mount[0] + rotation[axis, 1] * mount[1] + rotation[axis, 2] * mount[2]
        origin[axis] = position[axis] + arm


@kernel()
def turn(camera, direction, way):
    """Fill a ray's direction in the world."""
    for axis in range(3):
        way[axis] = camera[axis, 0] * direction[0] + camera[axis, 1] * direction[1] + camera[axis, 2] * direction[2]


@kernel()
def probe(grid, sight, rotations, positions, colors):
    """Fill the colours (n, m, 3) that the field shows of m pixels from n body poses, without derivatives."""
    directions, camera = sight[0], np.empty((3, 3))
    origin, way = np.empty(3, np.float32), np.empty(3, np.float32)
    scratch = probe_scratch()
    for n in range(colors.shape[0]):
        product(rotations[n], sight[2], camera)
        center(rotations[n], positions[n], sight[3], origin)
        for pixel in range(directions.shape[0]):
            turn(camera, directions[pixel], way)
            probe_along(grid, (origin, way), colors[n, pixel], scratch)
