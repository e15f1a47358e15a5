"""Density and its gradient at points: twin of `VoxelField.density`."""

import math

from nerfnav.core.jit import kernel, prange
from nerfnav.field.kernels.cells import BLOCK_SHIFT, NEGLIGIBLE_RAW, node_counts, part_of

CHUNK = 256
"""Points that one thread takes at a time."""


@kernel(inline=True)
def density_of_rows(values, occupied, lower, per_meter, scale, points, rows, density, gradient):
    """rho [1/m] at the points of some rows (first, end) and d rho / d p [1/m^2]; zero outside the grid.

    One loop and no call for each point: handing arrays over would take longer than what is done with them.
    """
    nx, ny, nz = node_counts(values, lower)
    for n in range(rows[0], rows[1]):
        density[n], gradient[n, 0], gradient[n, 1], gradient[n, 2] = 0.0, 0.0, 0.0, 0.0
        x = (points[n, 0] - lower[0]) * per_meter[0]
        y = (points[n, 1] - lower[1]) * per_meter[1]
        z = (points[n, 2] - lower[2]) * per_meter[2]
        if not (0.0 <= x <= nx - 1 and 0.0 <= y <= ny - 1 and 0.0 <= z <= nz - 1):
            continue
        i, j, k = min(int(x), nx - 2), min(int(y), ny - 2), min(int(z), nz - 2)
        if not occupied[i >> BLOCK_SHIFT, j >> BLOCK_SHIFT, k >> BLOCK_SHIFT]:
            continue
        x, y, z = x - i, y - j, z - k
        part, i, j, k = part_of(values, occupied, i, j, k)
        # along z at the four edges, then along y at the two faces, then along x
        edge00, slope00 = part[i, j, k, 0], part[i, j, k + 1, 0] - part[i, j, k, 0]
        edge01, slope01 = part[i, j + 1, k, 0], part[i, j + 1, k + 1, 0] - part[i, j + 1, k, 0]
        edge10, slope10 = part[i + 1, j, k, 0], part[i + 1, j, k + 1, 0] - part[i + 1, j, k, 0]
        edge11, slope11 = part[i + 1, j + 1, k, 0], part[i + 1, j + 1, k + 1, 0] - part[i + 1, j + 1, k, 0]
        edge00, edge01 = edge00 + z * slope00, edge01 + z * slope01
        edge10, edge11 = edge10 + z * slope10, edge11 + z * slope11
        near, far = edge00 + y * (edge01 - edge00), edge10 + y * (edge11 - edge10)
        raw = near + x * (far - near)
        if raw < NEGLIGIBLE_RAW:
            continue
        exponential = math.exp(-abs(raw))
        density[n] = scale * (max(raw, 0.0) + math.log1p(exponential))
        slope = scale * (1.0 if raw > 0.0 else exponential) / (1.0 + exponential)
        gradient[n, 0] = slope * per_meter[0] * (far - near)
        gradient[n, 1] = slope * per_meter[1] * ((1.0 - x) * (edge01 - edge00) + x * (edge11 - edge10))
        along_z = (1.0 - x) * ((1.0 - y) * slope00 + y * slope01) + x * ((1.0 - y) * slope10 + y * slope11)
        gradient[n, 2] = slope * per_meter[2] * along_z


@kernel()
def density_and_gradient(values, occupied, lower, per_meter, scale, points, density, gradient):
    """Fill density (n) and gradient (n, 3) at points (n, 3), in one thread."""
    rows = (0, points.shape[0])
    density_of_rows(values, occupied, lower, per_meter, scale, points, rows, density, gradient)


@kernel(parallel=True)
def density_and_gradient_parallel(values, occupied, lower, per_meter, scale, points, density, gradient):
    """The same in all threads: pays from some thousand points on."""
    count = points.shape[0]
    for chunk in prange((count + CHUNK - 1) // CHUNK):
        rows = (chunk * CHUNK, min(count, (chunk + 1) * CHUNK))
        density_of_rows(values, occupied, lower, per_meter, scale, points, rows, density, gradient)
