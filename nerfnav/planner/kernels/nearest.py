"""Nearest dense node of a grid to each of many points, as far as it can be the nearest of all."""

import math

import numpy as np

from nerfnav.core.jit import kernel
from nerfnav.field.kernels.cells import BLOCK_SHIFT, node_counts, part_of


@kernel()
def nearest_dense(values, occupied, lower, per_meter, threshold, points, reach, slack, nodes):
    """Fill nodes (n, 3) with the dense node [m] nearest to each point (n, 3); returns the distances (n) [m].

    A point is only looked around within `reach` [m], and within `slack` [m] more than the smallest distance that was
    found so far: what is infinite is farther than that.
    """
    counts, side = node_counts(values, lower), 1 << BLOCK_SHIFT
    distances = np.full(points.shape[0], np.inf)
    least = reach
    for n in range(points.shape[0]):
        best = min(reach, least + slack)
        i0, i1 = _blocks(points[n, 0] - lower[0], best, per_meter[0], occupied.shape[0])
        j0, j1 = _blocks(points[n, 1] - lower[1], best, per_meter[1], occupied.shape[1])
        k0, k1 = _blocks(points[n, 2] - lower[2], best, per_meter[2], occupied.shape[2])
        for x in range(i0, i1):
            for y in range(j0, j1):
                for z in range(k0, k1):
                    if not occupied[x, y, z]:
                        continue
                    for i in range(x * side, min(x * side + side + 1, counts[0])):
                        for j in range(y * side, min(y * side + side + 1, counts[1])):
                            for k in range(z * side, min(z * side + side + 1, counts[2])):
                                # its border nodes are in the brick of the block itself
                                part, a, b, c = part_of(values, occupied, x * side, y * side, z * side)
                                if part[a + i - x * side, b + j - y * side, c + k - z * side, 0] <= threshold:
                                    continue
                                u = i / per_meter[0] + lower[0] - points[n, 0]
                                v = j / per_meter[1] + lower[1] - points[n, 1]
                                w = k / per_meter[2] + lower[2] - points[n, 2]
                                away = math.sqrt(u * u + v * v + w * w)
                                if away <= best:
                                    best, distances[n] = away, away
                                    nodes[n, 0], nodes[n, 1] = points[n, 0] + u, points[n, 1] + v
                                    nodes[n, 2] = points[n, 2] + w
        least = min(least, distances[n])
    return distances


@kernel(inline=True)
def _blocks(offset, reach, per_meter, count):
    """The blocks along an axis from `reach` [m] before a point to as much behind it: from the first up to the last."""
    side = 1 << BLOCK_SHIFT
    first = math.floor((offset - reach) * per_meter / side)
    last = math.floor((offset + reach) * per_meter / side)
    return max(first, 0), min(last + 1, count)
