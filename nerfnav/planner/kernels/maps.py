"""Occupancy on grids: dense cells to columns, columns to positions of a body, the cost of each position, and the
nearest dense node to a point.

Nothing that is dense is left out on the way. Between the 8 corners of a cell raw densities are trilinear, so along
each axis the dense part of a cell ends no farther than on one of its four edges: the box between these ends holds all
of it, however much finer or coarser the map is than the grid.
"""

import math

import numpy as np

from nerfnav.core.jit import kernel, prange
from nerfnav.field.kernels.cells import BLOCK_SHIFT, between, node_counts, part_of


@kernel()
def _edge(first, second, threshold, reach):
    """Widen `reach`, the dense interval along an axis of a cell, by that of one edge between two nodes."""
    low, high = reach
    if first > threshold:
        end = 1.0 if second > threshold else (first - threshold) / (first - second)
        return min(low, 0.0), max(high, end)
    if second > threshold:
        return min(low, 1.0 - (second - threshold) / (second - first)), max(high, 1.0)
    return low, high


@kernel()
def _dense_part(part, i, j, k, threshold):
    """The dense intervals of a cell along x, y, z, in cells from its first node; empty ones where nothing is dense."""
    along_x, along_y, along_z = (2.0, -1.0), (2.0, -1.0), (2.0, -1.0)
    dense = 0
    for a in range(2):
        for b in range(2):
            dense += (part[i + a, j + b, k, 0] > threshold) + (part[i + a, j + b, k + 1, 0] > threshold)
    if dense == 0:
        return along_x, along_y, along_z
    if dense == 8:
        return (0.0, 1.0), (0.0, 1.0), (0.0, 1.0)
    for a in range(2):
        for b in range(2):
            along_x = _edge(part[i, j + a, k + b, 0], part[i + 1, j + a, k + b, 0], threshold, along_x)
            along_y = _edge(part[i + a, j, k + b, 0], part[i + a, j + 1, k + b, 0], threshold, along_y)
            along_z = _edge(part[i + a, j + b, k, 0], part[i + a, j + b, k + 1, 0], threshold, along_z)
    return along_x, along_y, along_z


@kernel()
def _range(first, last, ratio, reach, count):
    """Indices of a map's nodes from `reach` before node coordinate `first` of a grid to as much behind `last`."""
    low = math.ceil(first * ratio - reach - 1e-6)
    high = math.floor(last * ratio + reach + 1e-6)
    return max(low, 0), min(high, count - 1)


@kernel()
def _dense_nodes(part, corner, cells, threshold, dense):
    """Fill `dense` with which nodes of a block are dense, 1 or 0, and return how many are.

    The block has its first node at `corner` of the values `part`, and `cells` along x, y, z.
    """
    count = 0
    for i in range(cells[0] + 1):
        for j in range(cells[1] + 1):
            for k in range(cells[2] + 1):
                found = 1 if part[corner[0] + i, corner[1] + j, corner[2] + k, 0] > threshold else 0
                dense[i, j, k] = found
                count += found
    return count


@kernel()
def _set(columns, ratios, half_height, along_x, along_y, along_z):
    """Set the columns that a dense interval along x, y and z reaches [nodes of the grid]."""
    i0, i1 = _range(along_x[0], along_x[1], ratios[0], 0.5, columns.shape[0])
    j0, j1 = _range(along_y[0], along_y[1], ratios[1], 0.5, columns.shape[1])
    k0, k1 = _range(along_z[0], along_z[1], ratios[2], half_height, columns.shape[2])
    for m in range(i0, i1 + 1):
        for n in range(j0, j1 + 1):
            for o in range(k0, k1 + 1):
                columns[m, n, o] = 1


@kernel(parallel=True)
def mark_columns(values, occupied, lower, threshold, half_height, columns):
    """Set columns (fx, fy, nz), nodes over the same box as the grid, where raw densities exceed `threshold` anywhere
    within half a column along x and y, and within `half_height`, in nodes of `columns`, along z.

    What is dense throughout is set in one go, a block or a run of cells: the columns of neighbouring cells leave none
    out between them.
    """
    counts = node_counts(values, lower)
    side = 1 << BLOCK_SHIFT
    ratios = (
        (columns.shape[0] - 1) / (counts[0] - 1),
        (columns.shape[1] - 1) / (counts[1] - 1),
        (columns.shape[2] - 1) / (counts[2] - 1),
    )
    blocks_x, blocks_y, blocks_z = occupied.shape
    for block_x in prange(blocks_x):  # two threads may set the same column, to the same number
        dense, x = np.empty((side + 1, side + 1, side + 1), np.uint8), block_x * side
        for y in range(0, blocks_y * side, side):
            for z in range(0, blocks_z * side, side):
                if not occupied[block_x, y >> BLOCK_SHIFT, z >> BLOCK_SHIFT]:
                    continue
                cells = (min(side, counts[0] - 1 - x), min(side, counts[1] - 1 - y), min(side, counts[2] - 1 - z))
                part, a, b, c = part_of(values, occupied, x, y, z)
                found = _dense_nodes(part, (a, b, c), cells, threshold, dense)
                if found == 0:
                    continue
                if found == (cells[0] + 1) * (cells[1] + 1) * (cells[2] + 1):
                    spans = ((x, x + cells[0]), (y, y + cells[1]), (z, z + cells[2]))
                    _set(columns, ratios, half_height, spans[0], spans[1], spans[2])
                    continue
                for i in range(cells[0]):
                    for j in range(cells[1]):
                        begun = -1  # of a run of cells that are dense throughout
                        for k in range(cells[2] + 1):
                            corners = 0
                            if k < cells[2]:
                                for d in range(4):
                                    m, n = i + (d >> 1), j + (d & 1)
                                    corners += dense[m, n, k] + dense[m, n, k + 1]
                            if corners == 8:
                                begun = k if begun < 0 else begun
                                continue
                            if begun >= 0:
                                spans = ((x + i, x + i + 1), (y + j, y + j + 1), (z + begun, z + k))
                                _set(columns, ratios, half_height, spans[0], spans[1], spans[2])
                                begun = -1
                            if corners == 0:
                                continue
                            along_x, along_y, along_z = _dense_part(part, a + i, b + j, c + k, threshold)
                            _set(
                                columns, ratios, half_height, (x + i + along_x[0], x + i + along_x[1]),
                                (y + j + along_y[0], y + j + along_y[1]), (z + k + along_z[0], z + k + along_z[1]),
                            )  # fmt: skip


@kernel(parallel=True)
def mark_bodies(columns, parts, outlines, spacing, marked):
    """Set marked (m, nx, ny, nz) where a body at every `parts`-th column of columns (fx, fy, nz) covers one that is
    set. `outlines` (m, 3) are half the length and width [m] over which columns count, and its heading [rad]; `spacing`
    (2) the columns' [m].

    Columns amid others only mark what is at them: whatever else covers them covers one of the outer ones too.
    """
    fx, fy, levels = columns.shape
    _, nx, ny, _ = marked.shape
    for index in prange(outlines.shape[0] * fx):  # two threads may set the same place, to the same number
        heading, i = index // fx, index % fx
        cosine, sine = math.cos(outlines[heading, 2]), math.sin(outlines[heading, 2])
        long, wide = outlines[heading, 0] + 1e-7, outlines[heading, 1] + 1e-7
        reach_x = int((long * abs(cosine) + wide * abs(sine)) / spacing[0]) + 1
        reach_y = int((long * abs(sine) + wide * abs(cosine)) / spacing[1]) + 1
        for j in range(fy):
            for k in range(levels):
                if not columns[i, j, k]:
                    continue
                if i % parts == 0 and j % parts == 0:
                    marked[heading, i // parts, j // parts, k] = 1
                if _amid(columns, i, j, k):
                    continue
                for a in range(max(0, -((reach_x - i) // parts)), min(nx - 1, (i + reach_x) // parts) + 1):
                    for b in range(max(0, -((reach_y - j) // parts)), min(ny - 1, (j + reach_y) // parts) + 1):
                        x, y = (a * parts - i) * spacing[0], (b * parts - j) * spacing[1]
                        if abs(x * cosine + y * sine) <= long and abs(y * cosine - x * sine) <= wide:
                            marked[heading, a, b, k] = 1


@kernel()
def _amid(columns, i, j, k):
    """Return True if all 8 neighbours of a column are set too."""
    if i == 0 or j == 0 or i == columns.shape[0] - 1 or j == columns.shape[1] - 1:
        return False
    for a in range(i - 1, i + 2):
        for b in range(j - 1, j + 2):
            if not columns[a, b, k]:
                return False
    return True


@kernel()
def prices_near(occupied, spacing, clearance, weight):
    """Return the cost of a metre in each voxel (nx, ny, nz): 1 + weight (1 - d / clearance)^2 at a distance d [m] below
    `clearance` from the nearest occupied one, 1 beyond; infinite in those."""
    nx, ny, nz = occupied.shape
    prices = np.ones((nx, ny, nz))
    rx, ry = min(int(clearance / spacing[0]), nx), min(int(clearance / spacing[1]), ny)
    rz = min(int(clearance / spacing[2]), nz)
    for i in range(nx):
        for j in range(ny):
            for k in range(nz):
                if not occupied[i, j, k]:
                    continue
                prices[i, j, k] = np.inf
                if not _has_free_side(occupied, i, j, k):
                    continue  # never the nearest of anything
                for a in range(max(i - rx, 0), min(i + rx + 1, nx)):
                    for b in range(max(j - ry, 0), min(j + ry + 1, ny)):
                        for c in range(max(k - rz, 0), min(k + rz + 1, nz)):
                            if occupied[a, b, c]:
                                continue
                            x, y, z = (a - i) * spacing[0], (b - j) * spacing[1], (c - k) * spacing[2]
                            away = math.sqrt(x * x + y * y + z * z)
                            if away < clearance:
                                price = 1.0 + weight * (1.0 - away / clearance) ** 2
                                prices[a, b, c] = max(prices[a, b, c], price)
    return prices


@kernel()
def _has_free_side(occupied, i, j, k):
    nx, ny, nz = occupied.shape
    return (
        (i > 0 and not occupied[i - 1, j, k]) or (i + 1 < nx and not occupied[i + 1, j, k])
        or (j > 0 and not occupied[i, j - 1, k]) or (j + 1 < ny and not occupied[i, j + 1, k])
        or (k > 0 and not occupied[i, j, k - 1]) or (k + 1 < nz and not occupied[i, j, k + 1])
    )  # fmt: skip


@kernel()
def nearest_dense(values, occupied, lower, per_meter, threshold, points, reach, slack, nodes):
    """Fill nodes (n, 3) with the dense node [m] nearest to each point (n, 3); returns the distances (n) [m].

    A point is only looked around within `reach` [m], and within `slack` [m] more than the smallest distance that was
    found so far: what is infinite is farther than that. Nor is it looked around farther than the node that the point
    before it is nearest to, as most points lie beside the one before.
    """
    counts, side = node_counts(values, lower), 1 << BLOCK_SHIFT
    distances = np.full(points.shape[0], np.inf)
    looked = np.zeros(occupied.shape, np.int8)  # 1: the block has dense nodes, -1: it has none
    least = reach
    for n in range(points.shape[0]):
        best = min(reach, least + slack)
        if n > 0 and distances[n - 1] < np.inf:
            u, v = nodes[n - 1, 0] - points[n, 0], nodes[n - 1, 1] - points[n, 1]
            w = nodes[n - 1, 2] - points[n, 2]
            best = min(best, math.sqrt(u * u + v * v + w * w) + 1e-9)
        i0, i1 = _blocks(points[n, 0] - lower[0], best, per_meter[0], occupied.shape[0])
        j0, j1 = _blocks(points[n, 1] - lower[1], best, per_meter[1], occupied.shape[1])
        k0, k1 = _blocks(points[n, 2] - lower[2], best, per_meter[2], occupied.shape[2])
        for x in range(i0, i1):
            for y in range(j0, j1):
                for z in range(k0, k1):
                    if not occupied[x, y, z] or looked[x, y, z] < 0:
                        continue
                    if looked[x, y, z] == 0:
                        looked[x, y, z] = 1 if _has_dense(values, occupied, counts, threshold, x, y, z) else -1
                        if looked[x, y, z] < 0:
                            continue
                    u = _off_block(x, points[n, 0] - lower[0], per_meter[0])
                    v = _off_block(y, points[n, 1] - lower[1], per_meter[1])
                    w = _off_block(z, points[n, 2] - lower[2], per_meter[2])
                    if u * u + v * v + w * w > best * best:
                        continue
                    for i in range(x * side, min(x * side + side + 1, counts[0])):
                        u = i / per_meter[0] + lower[0] - points[n, 0]
                        if abs(u) > best:
                            continue
                        for j in range(y * side, min(y * side + side + 1, counts[1])):
                            v = j / per_meter[1] + lower[1] - points[n, 1]
                            if u * u + v * v > best * best:
                                continue
                            for k in range(z * side, min(z * side + side + 1, counts[2])):
                                # its border nodes are in the brick of the block itself
                                part, a, b, c = part_of(values, occupied, x * side, y * side, z * side)
                                if part[a + i - x * side, b + j - y * side, c + k - z * side, 0] <= threshold:
                                    continue
                                w = k / per_meter[2] + lower[2] - points[n, 2]
                                away = math.sqrt(u * u + v * v + w * w)
                                if away <= best:
                                    best, distances[n] = away, away
                                    nodes[n, 0], nodes[n, 1] = points[n, 0] + u, points[n, 1] + v
                                    nodes[n, 2] = points[n, 2] + w
        least = min(least, distances[n])
    return distances


@kernel()
def _has_dense(values, occupied, counts, threshold, x, y, z):
    """Return True if a node of a block, those at its border among them, is dense."""
    side = 1 << BLOCK_SHIFT
    part, a, b, c = part_of(values, occupied, x * side, y * side, z * side)
    for i in range(min(side + 1, counts[0] - x * side)):
        for j in range(min(side + 1, counts[1] - y * side)):
            for k in range(min(side + 1, counts[2] - z * side)):
                if part[a + i, b + j, c + k, 0] > threshold:
                    return True
    return False


@kernel()
def _off_block(index, offset, per_meter):
    """Return the distance of a point from a block along an axis, a little less [m]; 0 inside."""
    side = 1 << BLOCK_SHIFT
    first, last = index * side / per_meter, (index + 1) * side / per_meter
    return max(0.0, first - offset - 1e-9, offset - last - 1e-9)


@kernel()
def bisect_entries(values, occupied, lower, per_meter, threshold, halvings, free, solid):
    """Move `free` and `solid` (n, 3) [m] towards where the lines from the one to the other enter what is dense: each
    time by half, to a place on the same side. Beyond the grid its border counts."""
    counts = node_counts(values, lower)
    for n in range(free.shape[0]):
        for _ in range(halvings):
            x, y, z = (
                0.5 * (free[n, 0] + solid[n, 0]), 0.5 * (free[n, 1] + solid[n, 1]), 0.5 * (free[n, 2] + solid[n, 2])
            )  # fmt: skip
            u = min(max((x - lower[0]) * per_meter[0], 0.0), counts[0] - 1.0)
            v = min(max((y - lower[1]) * per_meter[1], 0.0), counts[1] - 1.0)
            w = min(max((z - lower[2]) * per_meter[2], 0.0), counts[2] - 1.0)
            i, j, k = min(int(u), counts[0] - 2), min(int(v), counts[1] - 2), min(int(w), counts[2] - 2)
            dense = False
            if occupied[i >> BLOCK_SHIFT, j >> BLOCK_SHIFT, k >> BLOCK_SHIFT]:
                part, a, b, c = part_of(values, occupied, i, j, k)
                dense = between(part, 0, a, b, c, u - i, v - j, w - k) > threshold
            if dense:
                solid[n, 0], solid[n, 1], solid[n, 2] = x, y, z
            else:
                free[n, 0], free[n, 1], free[n, 2] = x, y, z


@kernel()
def _blocks(offset, reach, per_meter, count):
    """The blocks along an axis from `reach` [m] before a point to as much behind it: from the first up to the last."""
    side = 1 << BLOCK_SHIFT
    first = math.floor((offset - reach) * per_meter / side)
    last = math.floor((offset + reach) * per_meter / side)
    return max(first, 0), min(last + 1, count)


@kernel()
def weigh(values, first, weights, sums):
    """Fill `sums` (a, m, b) with weighted sums of `values` (a, n, b): for each k those of nodes first[k] on with
    weights[k], (m, w)."""
    inner = values.shape[2]
    for i in range(values.shape[0]):
        for k in range(first.shape[0]):
            at = first[k]
            if inner == 1:  # along the last axis: vectorised over the weights
                total = np.float32(0.0)
                for j in range(weights.shape[1]):
                    total += weights[k, j] * values[i, at + j, 0]
                sums[i, k, 0] = total
                continue
            for c in range(inner):
                sums[i, k, c] = weights[k, 0] * values[i, at, c]
            for j in range(1, weights.shape[1]):
                for c in range(inner):
                    sums[i, k, c] += weights[k, j] * values[i, at + j, c]
