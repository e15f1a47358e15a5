"""Rays of chosen pixels of posed images: twin of `Camera.rays`, for many cameras at once."""

import math

import numpy as np

from nerfnav.compiled import kernel, prange


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
