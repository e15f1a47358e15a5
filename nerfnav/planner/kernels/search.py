"""A* on a grid of prices (Hart, Nilsson, Raphael, 1968), 26 neighbours and turns, a binary heap with lazy deletion."""

import heapq
import math

import numpy as np

from nerfnav.compiled import kernel


@kernel()
def cheapest_path(prices, start, goal, turn, greed):
    """Nodes (n, 4), heading and voxel, of the cheapest way from `start` to `goal`, both included; n = 0: there is none.

    `prices` (m, nx, ny, nz) are for m headings over half a turn, and a full turn has 2 m; with m = 1 headings do not
    matter. A move costs its length, in voxels, times the mean price of its two voxels; to turn by one heading costs
    `turn`. Prices are at least 1, so that the straight distance never overestimates; infinite prices are walls. The
    distance ahead counts `greed` times: with more than 1 far fewer voxels are looked at, and the way costs at most
    `greed` times the least (Pohl, 1970).
    """
    m, nx, ny, nz = prices.shape
    around = 2 * m if m > 1 else 1
    layer = nx * ny * nz
    flat = prices.ravel()
    cost = np.full(around * layer, np.inf)
    came_from = np.full(around * layer, -1, np.int64)
    first = start[0] * layer + (start[1] * ny + start[2]) * nz + start[3]
    last = goal[0] * layer + (goal[1] * ny + goal[2]) * nz + goal[3]
    closed = np.zeros(around * layer, np.bool_)
    lengths = np.sqrt(np.arange(4.0))
    cost[first] = 0.0
    queue = [(0.0, first)]
    while len(queue) > 0:
        _, node = heapq.heappop(queue)
        if node == last:
            break
        if closed[node]:
            continue  # a cheaper way here was found after this entry was queued
        closed[node] = True
        spent, h, voxel = cost[node], node // layer, node % layer
        column, k = voxel // nz, voxel % nz
        i, j = column // ny, column % ny
        own_layer, own_nodes = h % m * layer, h * layer
        own = flat[own_layer + voxel]
        turned = turn * min(abs(h - goal[0]), around - abs(h - goal[0]))
        for a in range(max(i - 1, 0), min(i + 2, nx)):
            for b in range(max(j - 1, 0), min(j + 2, ny)):
                across, beside = (a - goal[1]) ** 2 + (b - goal[2]) ** 2, (a - i) ** 2 + (b - j) ** 2
                for c in range(max(k - 1, 0), min(k + 2, nz)):
                    target = (a * ny + b) * nz + c
                    other = own_nodes + target
                    total = spent + 0.5 * lengths[beside + (c - k) ** 2] * (own + flat[own_layer + target])
                    if total < cost[other] and not closed[other]:
                        cost[other] = total
                        came_from[other] = node
                        ahead = math.sqrt(across + (c - goal[3]) ** 2)
                        heapq.heappush(queue, (total + greed * (ahead + turned), other))
        if around == 1:
            continue
        ahead = math.sqrt((i - goal[1]) ** 2 + (j - goal[2]) ** 2 + (k - goal[3]) ** 2)
        for side in range(-1, 2, 2):
            heading = (h + side + around) % around
            other = heading * layer + voxel
            total = spent + turn * 0.5 * (own + flat[heading % m * layer + voxel])
            if total < cost[other] and not closed[other]:
                cost[other] = total
                came_from[other] = node
                turned = turn * min(abs(heading - goal[0]), around - abs(heading - goal[0]))
                heapq.heappush(queue, (total + greed * (ahead + turned), other))
    return _trace(came_from, cost, last, (nx, ny, nz))


@kernel(inline=True)
def _trace(came_from, cost, last, shape):
    """The way that led to `last`, from its beginning; empty where it was never reached."""
    if not cost[last] < np.inf:
        return np.zeros((0, 4), np.int64)
    nx, ny, nz = shape
    count, node = 0, last
    while node >= 0:
        count, node = count + 1, came_from[node]
    path, node = np.zeros((count, 4), np.int64), last
    for row in range(count - 1, -1, -1):
        path[row, 0], path[row, 1] = node // (nx * ny * nz), node // (ny * nz) % nx
        path[row, 2], path[row, 3] = node // nz % ny, node % nz
        node = came_from[node]
    return path


@kernel()
def make_dearer(prices, path, reach, factor):
    """Multiply prices (m, nx, ny, nz) by `factor` within `reach` voxels of a path (n, 4), the surroundings of its ends
    left out."""
    _, nx, ny, nz = prices.shape
    done = np.zeros((nx, ny, nz), np.bool_)
    for row in range(path.shape[0]):
        if min(row, path.shape[0] - 1 - row) < reach:
            continue
        i, j, k = path[row, 1], path[row, 2], path[row, 3]
        for a in range(max(i - reach, 0), min(i + reach + 1, nx)):
            for b in range(max(j - reach, 0), min(j + reach + 1, ny)):
                for c in range(max(k - reach, 0), min(k + reach + 1, nz)):
                    near = (a - i) ** 2 + (b - j) ** 2 + (c - k) ** 2 <= reach * reach
                    if near and not done[a, b, c]:
                        done[a, b, c] = True
                        for h in range(prices.shape[0]):
                            prices[h, a, b, c] *= factor
