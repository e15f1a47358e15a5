"""Density and its gradient at points: twin of `VoxelField.density`."""

import numba
import numpy as np

from nerfnav.compiled import kernel
from nerfnav.field.kernels.cells import cell_of, corner_weights, interpolate, sigmoid, softplus


@kernel(parallel=True)
def density_and_gradient(values, lower, per_meter, points, scale):
    """rho (n) [1/m] and d rho / d p (n, 3) [1/m^2]; zero outside the grid."""
    count = points.shape[0]
    shape = values.shape
    density = np.zeros(count, np.float32)
    gradient = np.zeros((count, 3), np.float32)
    for n in numba.prange(count):
        cell, fraction = np.empty(3, np.int64), np.empty(3, np.float32)
        weights = np.empty(8, np.float32)
        inside = True
        for axis in range(3):
            coordinate = (points[n, axis] - lower[axis]) * per_meter[axis]
            inside = inside and np.float32(0.0) <= coordinate <= np.float32(shape[axis] - 1)
            cell[axis], fraction[axis] = cell_of(coordinate, shape[axis])
        if not inside:
            continue
        i, j, k = cell[0], cell[1], cell[2]
        x, y, z = fraction[0], fraction[1], fraction[2]
        corner_weights(x, y, z, weights)
        raw = interpolate(values, 0, i, j, k, weights)
        density[n] = scale * softplus(raw)
        slope = scale * sigmoid(raw)
        for axis in range(3):
            # the derivative of trilinear weights along an axis: the far face minus the near face
            corner_weights(
                np.float32(1.0) if axis == 0 else x,
                np.float32(1.0) if axis == 1 else y,
                np.float32(1.0) if axis == 2 else z,
                weights,
            )
            far = interpolate(values, 0, i, j, k, weights)
            corner_weights(
                np.float32(0.0) if axis == 0 else x,
                np.float32(0.0) if axis == 1 else y,
                np.float32(0.0) if axis == 2 else z,
                weights,
            )
            gradient[n, axis] = slope * per_meter[axis] * (far - interpolate(values, 0, i, j, k, weights))
    return density, gradient
