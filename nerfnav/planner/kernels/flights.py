"""Sampled flights on grids: which of them touch something, and whether before they arrive.

A body touches something where raw density is above a threshold at one of its points. Between nodes it is trilinear;
beyond the border of the grid it is as at the border. A summed-volume table (Crow, "Summed-area tables for texture
mapping", 1984) of the cells that may hold something dense, around all flights in a step, rules most poses out.
"""

import math

import numpy as np

from nerfnav.core.jit import kernel
from nerfnav.field.kernels.cells import BLOCK_SHIFT, node_counts, part_of

ROUNDING = 1e-6
"""Share of a node by which rounding may move a place."""


@kernel()
def _cell(coordinate, count):
    """Cell along an axis that holds a coordinate [nodes], clamped to the grid of `count` nodes."""
    return min(max(math.floor(coordinate), 0), count - 2)


@kernel()
def _has_dense_corner(values, occupied, i, j, k, threshold):
    """1 if raw density is above the threshold at a corner of a cell, so that it may be so inside, else 0."""
    if not occupied[i >> BLOCK_SHIFT, j >> BLOCK_SHIFT, k >> BLOCK_SHIFT]:
        return 0
    part, i, j, k = part_of(values, occupied, i, j, k)
    for a in range(2):
        for b in range(2):
            for c in range(2):
                if part[i + a, j + b, k + c, 0] > threshold:
                    return 1
    return 0


@kernel()
def _count_cells(values, occupied, first, last, threshold):
    """Count the cells with a dense corner from `first` up to any index below each (i, j, k): a summed-volume table."""
    shape = (last[0] - first[0] + 2, last[1] - first[1] + 2, last[2] - first[2] + 2)
    sums = np.zeros(shape, np.int32)
    for i in range(1, shape[0]):
        for j in range(1, shape[1]):
            row = 0
            for k in range(1, shape[2]):
                cell = (first[0] + i - 1, first[1] + j - 1, first[2] + k - 1)
                row += _has_dense_corner(values, occupied, cell[0], cell[1], cell[2], threshold)
                sums[i, j, k] = row + sums[i - 1, j, k] + sums[i, j - 1, k] - sums[i - 1, j - 1, k]
    return sums


@kernel()
def _may_touch(sums, first, counts, centre, half):
    """True if a box, given by its centre and half edges [nodes], meets a cell with a dense corner."""
    i0, i1 = _cell(centre[0] - half[0], counts[0]) - first[0], _cell(centre[0] + half[0], counts[0]) - first[0] + 1
    j0, j1 = _cell(centre[1] - half[1], counts[1]) - first[1], _cell(centre[1] + half[1], counts[1]) - first[1] + 1
    k0, k1 = _cell(centre[2] - half[2], counts[2]) - first[2], _cell(centre[2] + half[2], counts[2]) - first[2] + 1
    upper = sums[i1, j1, k1] - sums[i0, j1, k1] - sums[i1, j0, k1] + sums[i0, j0, k1]
    lower = sums[i1, j1, k0] - sums[i0, j1, k0] - sums[i1, j0, k0] + sums[i0, j0, k0]
    return upper > lower


@kernel()
def _is_dense(values, occupied, counts, x, y, z, threshold):
    """True if raw density is above the threshold at a place [nodes]."""
    x, y, z = min(max(x, 0.0), counts[0] - 1.0), min(max(y, 0.0), counts[1] - 1.0), min(max(z, 0.0), counts[2] - 1.0)
    i, j, k = min(int(x), counts[0] - 2), min(int(y), counts[1] - 2), min(int(z), counts[2] - 2)
    if not occupied[i >> BLOCK_SHIFT, j >> BLOCK_SHIFT, k >> BLOCK_SHIFT]:
        return False
    x, y, z = x - i, y - j, z - k
    part, i, j, k = part_of(values, occupied, i, j, k)
    edge00 = part[i, j, k, 0] + z * (part[i, j, k + 1, 0] - part[i, j, k, 0])
    edge01 = part[i, j + 1, k, 0] + z * (part[i, j + 1, k + 1, 0] - part[i, j + 1, k, 0])
    edge10 = part[i + 1, j, k, 0] + z * (part[i + 1, j, k + 1, 0] - part[i + 1, j, k, 0])
    edge11 = part[i + 1, j + 1, k, 0] + z * (part[i + 1, j + 1, k + 1, 0] - part[i + 1, j + 1, k, 0])
    near, far = edge00 + y * (edge01 - edge00), edge10 + y * (edge11 - edge10)
    return near + x * (far - near) > threshold


@kernel()
def mark_hits(values, occupied, lower, per_meter, threshold, centres, turns, arrived, fractions, offsets, hit):
    """Set `hit` (n) for flights that touch something before they arrive.

    centres (times, n, 3) [m], turns (times, n) [rad] from the planned heading, and arrived (times, n) are those of each
    flight, fractions (k) the shares of a step at which the body is checked, and offsets (steps, k, b, 3) [m] from its
    centre to its points there, with the planned attitude.
    """
    counts = node_counts(values, lower)
    steps, parts, points = offsets.shape[0], offsets.shape[1], offsets.shape[2]
    low, high, half = np.empty(3), np.empty(3), np.empty(3)
    for t in range(steps):
        level, upright = 0.0, 0.0
        for f in range(parts):
            for b in range(points):
                level = max(level, math.hypot(offsets[t, f, b, 0], offsets[t, f, b, 1]))
                upright = max(upright, abs(offsets[t, f, b, 2]))
        low[:], high[:] = np.inf, -np.inf
        for n in range(hit.shape[0]):
            if not (hit[n] or arrived[t, n]):
                for axis in range(3):
                    low[axis] = min(low[axis], centres[t, n, axis], centres[t + 1, n, axis])
                    high[axis] = max(high[axis], centres[t, n, axis], centres[t + 1, n, axis])
        if low[0] > high[0]:  # none flies any more
            break
        for axis in range(3):
            half[axis] = (level if axis < 2 else upright) * per_meter[axis] + ROUNDING
            low[axis] = (low[axis] - lower[axis]) * per_meter[axis] - half[axis] - ROUNDING
            high[axis] = (high[axis] - lower[axis]) * per_meter[axis] + half[axis] + ROUNDING
        first = (_cell(low[0], counts[0]), _cell(low[1], counts[1]), _cell(low[2], counts[2]))
        last = (_cell(high[0], counts[0]), _cell(high[1], counts[1]), _cell(high[2], counts[2]))
        sums = _count_cells(values, occupied, first, last, threshold)
        if sums[-1, -1, -1] == 0:
            continue
        for f in range(parts):
            share = fractions[f]
            for n in range(hit.shape[0]):
                if hit[n] or arrived[t, n]:
                    continue
                x = centres[t, n, 0] + share * (centres[t + 1, n, 0] - centres[t, n, 0])
                y = centres[t, n, 1] + share * (centres[t + 1, n, 1] - centres[t, n, 1])
                z = centres[t, n, 2] + share * (centres[t + 1, n, 2] - centres[t, n, 2])
                x, y, z = (x - lower[0]) * per_meter[0], (y - lower[1]) * per_meter[1], (z - lower[2]) * per_meter[2]
                if not _may_touch(sums, first, counts, (x, y, z), half):
                    continue
                turn = turns[t, n] + share * (turns[t + 1, n] - turns[t, n])
                cosine, sine = math.cos(turn), math.sin(turn)
                for b in range(points):
                    along, aside = offsets[t, f, b, 0], offsets[t, f, b, 1]
                    ahead, left = cosine * along - sine * aside, sine * along + cosine * aside
                    up = offsets[t, f, b, 2]
                    u, v, w = x + ahead * per_meter[0], y + left * per_meter[1], z + up * per_meter[2]
                    if _is_dense(values, occupied, counts, u, v, w, threshold):
                        hit[n] = True
                        break
