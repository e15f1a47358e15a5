"""Splats into a grid: densities add, colours are means weighted by density.

Splat k adds a_k exp(-q / 2) to the density at grid coordinates g, q = (g - m_k)' P_k (g - m_k), up to q = `REACH`^2.
"""

import math

import numpy as np

from nerfnav.core.jit import kernel, prange

REACH = np.float32(3.5)
"""Standard deviations after which a splat ends: 0.2 % of its density."""
SLAB = 4
"""Layers of nodes along x that one thread fills at a time; no two threads write to the same node."""


@kernel(parallel=True)
def splat(centers, precisions, reaches, amplitudes, colors, density, color):
    """Add splats to `density` (nx, ny, nz) and a_k exp(-q / 2) colour to `color` (nx, ny, nz, 3).

    All in grid coordinates: centers (n, 3), precisions (n, 6) as xx, xy, xz, yy, yz, zz, reaches (n, 3): half edges of
    the boxes that hold the splats' ends, amplitudes (n), colors (n, 3).
    """
    nx, ny, nz = density.shape
    for slab in prange((nx + SLAB - 1) // SLAB):
        first, end = slab * SLAB, min(nx, (slab + 1) * SLAB)
        for k in range(centers.shape[0]):
            x0, x1 = span(centers[k, 0], reaches[k, 0], first, end)
            if x1 <= x0:
                continue
            y0, y1 = span(centers[k, 1], reaches[k, 1], 0, ny)
            z0, z1 = span(centers[k, 2], reaches[k, 2], 0, nz)
            xx, xy, xz = precisions[k, 0], precisions[k, 1], precisions[k, 2]
            yy, yz, zz = precisions[k, 3], precisions[k, 4], precisions[k, 5]
            red, green, blue = colors[k, 0], colors[k, 1], colors[k, 2]
            for i in range(x0, x1):
                dx = np.float32(i) - centers[k, 0]
                for j in range(y0, y1):
                    dy = np.float32(j) - centers[k, 1]
                    fixed = xx * dx * dx + np.float32(2.0) * xy * dx * dy + yy * dy * dy
                    slope = np.float32(2.0) * (xz * dx + yz * dy)
                    for m in range(z0, z1):
                        dz = np.float32(m) - centers[k, 2]
                        q = fixed + dz * (slope + zz * dz)
                        if q > REACH * REACH:
                            continue
                        added = amplitudes[k] * np.float32(math.exp(np.float32(-0.5) * q))
                        density[i, j, m] += added
                        color[i, j, m, 0] += added * red
                        color[i, j, m, 1] += added * green
                        color[i, j, m, 2] += added * blue


@kernel()
def span(center, reach, first, end):
    """The nodes from `first` to before `end` that lie within `reach` of `center`."""
    low = max(np.float32(first), np.float32(math.ceil(center - reach)))
    high = min(np.float32(end), np.float32(math.floor(center + reach)) + np.float32(1.0))
    return int(low), int(high)
