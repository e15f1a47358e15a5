"""A* on a grid of prices (Hart, Nilsson, Raphael, 1968), 26 neighbours, a binary heap with lazy deletion."""

import heapq
import math

import numpy as np

from nerfnav.compiled import kernel


@kernel()
def cheapest_path(prices, start, goal):
    """Voxels (n, 3) of the cheapest way from `start` to `goal`, both included; n = 0 where there is none.

    A move costs its length, in voxels, times the mean price of its two voxels. Prices are at least 1, so that the
    straight distance never overestimates; infinite prices are walls.
    """
    nx, ny, nz = prices.shape
    cost = np.full(prices.size, np.inf)
    came_from = np.full(prices.size, -1, np.int64)
    flat = prices.astype(np.float64).ravel()
    first, last = (start[0] * ny + start[1]) * nz + start[2], (goal[0] * ny + goal[1]) * nz + goal[2]
    cost[first] = 0.0
    queue = [(0.0, 0.0, first)]
    while len(queue) > 0:
        _, spent, node = heapq.heappop(queue)
        if node == last:
            break
        if spent > cost[node]:
            continue  # a cheaper way here was found after this entry was queued
        i, j, k = node // (ny * nz), node // nz % ny, node % nz
        for a in range(max(i - 1, 0), min(i + 2, nx)):
            for b in range(max(j - 1, 0), min(j + 2, ny)):
                for c in range(max(k - 1, 0), min(k + 2, nz)):
                    other = (a * ny + b) * nz + c
                    length = math.sqrt((a - i) ** 2 + (b - j) ** 2 + (c - k) ** 2)
                    total = spent + 0.5 * length * (flat[node] + flat[other])
                    if total < cost[other]:
                        cost[other] = total
                        came_from[other] = node
                        ahead = math.sqrt((a - goal[0]) ** 2 + (b - goal[1]) ** 2 + (c - goal[2]) ** 2)
                        heapq.heappush(queue, (total + ahead, total, other))
    return _trace(came_from, cost, last, ny, nz)


@kernel(inline=True)
def _trace(came_from, cost, last, ny, nz):
    """The way that led to `last`, from its beginning; empty where it was never reached."""
    if not cost[last] < np.inf:
        return np.zeros((0, 3), np.int64)
    count, node = 0, last
    while node >= 0:
        count, node = count + 1, came_from[node]
    path, node = np.zeros((count, 3), np.int64), last
    for row in range(count - 1, -1, -1):
        path[row, 0], path[row, 1], path[row, 2] = node // (ny * nz), node // nz % ny, node % nz
        node = came_from[node]
    return path
