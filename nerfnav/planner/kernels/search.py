"""A* on a grid of prices (Hart, Nilsson, Raphael, 1968), 26 neighbours and turns, a binary heap with lazy deletion.

The heuristic is the straight line; on a large map it is the cheapest path on one CLUSTER times as coarse, found
backwards from the goal first: around a long wall the straight line would have half of a hall searched.

The binary heap (Williams, 1964) is two arrays, keys (n) and nodes (n), of which the first `size` entries are in it;
the least is entry 0. A list of tuples would have its type checked at each step. Of equal keys the least node comes
first, so that the order in which entries come out depends on nothing but what is in it.
"""

import math

import numpy as np

from nerfnav.core.jit import kernel


@kernel()
def push(heap, size, key, node):
    """Add an entry to a heap that holds `size` and has room for it."""
    keys, nodes = heap
    at = size
    while at > 0:
        above = (at - 1) >> 1
        if keys[above] < key or (keys[above] == key and nodes[above] <= node):
            break
        keys[at], nodes[at] = keys[above], nodes[above]
        at = above
    keys[at], nodes[at] = key, node


@kernel()
def pop(heap, size):
    """Take the least entry out of a heap, in which `size` entries are left."""
    keys, nodes = heap
    key, node = keys[size], nodes[size]
    at, below = 0, 1
    while below < size:
        beside = below + 1
        if beside < size and (
            keys[beside] < keys[below] or (keys[beside] == keys[below] and nodes[beside] < nodes[below])
        ):
            below = beside
        if key < keys[below] or (key == keys[below] and node <= nodes[below]):
            break
        keys[at], nodes[at] = keys[below], nodes[below]
        at, below = below, 2 * below + 1
    keys[at], nodes[at] = key, node


@kernel()
def grown(heap):
    """The same heap with room for twice as many."""
    keys, nodes = heap
    count = keys.shape[0]
    more_keys, more_nodes = np.empty(2 * count), np.empty(2 * count, np.int64)
    for i in range(count):
        more_keys[i], more_nodes[i] = keys[i], nodes[i]
    return more_keys, more_nodes


CLUSTER = 4
"""Voxels along each edge of a voxel of the coarse map."""
_SLACK = 2.0 * CLUSTER * math.sqrt(3.0)
"""Largest excess of the coarse map's cost over the true one: a voxel's edge to edge at both ends."""
_CLOSED, _MOVE = 128, 127
_ROOM, _MOST_MOVES = 4096, 28
"""Entries that a queue has room for at first, and that a node may add to it."""


@kernel()
def cheapest_path(prices, guide, room, ends, turn, greed, most):
    """Search the cheapest path between two `ends`: nodes (n, 4), heading and voxel, both ends included; n = 0: none.

    Returns these, and False where the search was given up, for it had looked at more than `most` nodes.

    `prices` (m, nx, ny, nz) are for m headings over half a turn, and a full turn has 2 m; with m = 1 headings do not
    matter. A move costs its length, in voxels, times the mean price of its two voxels; to turn by one heading costs
    `turn`. Prices are at least 1, so that the straight distance never overestimates; infinite prices are walls. The
    distance ahead counts `greed` times: with more than 1 far fewer voxels are looked at, and the path costs at most
    `greed` times the least (Pohl, 1970).

    `guide` is from `costs_to`, or has no voxels. `room` = (cost, move), any float64 and a zero uint8 for each heading
    and voxel: memory that is zero anyway is only taken where it is looked at.
    """
    m, nx, ny, nz = prices.shape
    around = 2 * m if m > 1 else 1
    layer = nx * ny * nz
    flat = prices.ravel()
    cost, moves = room  # what has no move yet was never reached
    start, goal = ends
    first = start[0] * layer + (start[1] * ny + start[2]) * nz + start[3]
    last = goal[0] * layer + (goal[1] * ny + goal[2]) * nz + goal[3]
    offsets, lengths = _moves(ny, nz)
    cost[first] = 0.0
    queue, size = (np.empty(_ROOM), np.empty(_ROOM, np.int64)), 1
    queue[0][0], queue[1][0] = 0.0, first
    closed = 0
    while size > 0:
        node, size = queue[1][0], size - 1
        pop(queue, size)
        if node == last:
            break
        if moves[node] & _CLOSED:
            continue  # a cheaper way here was found after this entry was queued
        closed += 1
        if closed > most:
            return np.zeros((0, 4), np.int64), False
        moves[node] |= _CLOSED
        if size + _MOST_MOVES > queue[0].shape[0]:
            queue = grown(queue)
        spent, h, voxel = cost[node], node // layer, node % layer
        column, k = voxel // nz, voxel % nz
        i, j = column // ny, column % ny
        own_layer = h % m * layer
        own = flat[own_layer + voxel]
        turned = turn * min(abs(h - goal[0]), around - abs(h - goal[0]))
        inner = 0 < i < nx - 1 and 0 < j < ny - 1 and 0 < k < nz - 1
        for move in range(27):
            if not inner:
                a, b, c = i + move // 9 - 1, j + move // 3 % 3 - 1, k + move % 3 - 1
                if not (0 <= a < nx and 0 <= b < ny and 0 <= c < nz):
                    continue
            # unsigned: numba then need not ask whether an index counts from the end
            other = np.uint64(node + offsets[move])
            known = moves[other]
            if known & _CLOSED:
                continue
            total = spent + lengths[move] * (own + flat[np.uint64(own_layer + voxel + offsets[move])])
            if total < np.inf and (known == 0 or total < cost[other]):
                cost[other] = total
                moves[other] = 1 + move
                ahead = _ahead(guide, i + move // 9 - 1, j + move // 3 % 3 - 1, k + move % 3 - 1, goal)
                push(queue, size, total + greed * (ahead + turned), node + offsets[move])
                size += 1
        if around == 1:
            continue
        ahead = _ahead(guide, i, j, k, goal)
        for side in range(-1, 2, 2):
            heading = (h + side + around) % around
            other = heading * layer + voxel
            total = spent + turn * 0.5 * (own + flat[heading % m * layer + voxel])
            if total < np.inf and not moves[other] & _CLOSED and (moves[other] == 0 or total < cost[other]):
                cost[other] = total
                moves[other] = 28 if side < 0 else 29
                turned = turn * min(abs(heading - goal[0]), around - abs(heading - goal[0]))
                push(queue, size, total + greed * (ahead + turned), other)
                size += 1
    return _trace(moves, (first, last), (nx, ny, nz), around), True


@kernel()
def _moves(ny, nz):
    """Return the change of a node's number by each of the 27 moves, and half of their lengths [voxels]."""
    offsets, lengths = np.empty(27, np.int64), np.empty(27)
    for move in range(27):
        x, y, z = move // 9 - 1, move // 3 % 3 - 1, move % 3 - 1
        offsets[move], lengths[move] = (x * ny + y) * nz + z, 0.5 * math.sqrt(x * x + y * y + z * z)
    return offsets, lengths


@kernel()
def _ahead(guide, i, j, k, goal):
    """Estimate the cost from a voxel to the goal, without turns."""
    straight = math.sqrt((i - goal[1]) ** 2 + (j - goal[2]) ** 2 + (k - goal[3]) ** 2)
    if guide.shape[0] == 0:
        return straight
    return max(straight, guide[i // CLUSTER, j // CLUSTER, k // CLUSTER] - _SLACK)


@kernel()
def _trace(moves, ends, shape, around):
    """Trace the path between the ends by the moves that led there; empty where the last was never reached."""
    first, last = ends
    nx, ny, nz = shape
    layer = nx * ny * nz
    if last != first and moves[last] & _MOVE == 0:
        return np.zeros((0, 4), np.int64)
    count, node = 1, last
    while node != first:
        count, node = count + 1, _before(moves[node] & _MOVE, node, ny, nz, layer, around)
    path, node = np.zeros((count, 4), np.int64), last
    for row in range(count - 1, -1, -1):
        path[row, 0], path[row, 1] = node // layer, node % layer // (ny * nz)
        path[row, 2], path[row, 3] = node // nz % ny, node % nz
        if row > 0:
            node = _before(moves[node] & _MOVE, node, ny, nz, layer, around)
    return path


@kernel()
def _before(move, node, ny, nz, layer, around):
    """Return the node from which a move led here."""
    if move >= 28:
        heading = (node // layer + (1 if move == 28 else -1) + around) % around
        return heading * layer + node % layer
    move -= 1
    return node - (((move // 9 - 1) * ny + move // 3 % 3 - 1) * nz + move % 3 - 1)


@kernel()
def costs_to(prices, goal, least):
    """Compute the cost from each voxel of the coarse map (cx, cy, cz), in fine voxels, to the one of the goal (4);
    infinite where the goal cannot be reached (Dijkstra, 1959).

    With `least`, a coarse voxel costs as little as the cheapest of its fine ones with any heading, so that the true
    cost is never overestimated by much. Else it costs the mean of those that are free: nearer to the true cost where
    prices differ within few voxels, as around a path whose prices were raised.
    """
    m, nx, ny, nz = prices.shape
    sx, sy, sz = (nx + CLUSTER - 1) // CLUSTER, (ny + CLUSTER - 1) // CLUSTER, (nz + CLUSTER - 1) // CLUSTER
    price, free = np.full((sx, sy, sz), np.inf if least else 0.0), np.zeros((sx, sy, sz), np.int32)
    for h in range(m):
        for i in range(nx):
            for j in range(ny):
                for k in range(nz):
                    a, b, c = i // CLUSTER, j // CLUSTER, k // CLUSTER
                    fine = prices[h, i, j, k]
                    if least:
                        price[a, b, c] = min(price[a, b, c], fine)
                    elif fine < np.inf:
                        price[a, b, c] += fine
                        free[a, b, c] += 1
    if not least:
        for a in range(sx):
            for b in range(sy):
                for c in range(sz):
                    price[a, b, c] = price[a, b, c] / free[a, b, c] if free[a, b, c] > 0 else np.inf
    left = np.full((sx, sy, sz), np.inf)
    lengths = np.sqrt(np.arange(4.0)) * CLUSTER
    x, y, z = goal[1] // CLUSTER, goal[2] // CLUSTER, goal[3] // CLUSTER
    left[x, y, z] = 0.0
    queue, size = (np.empty(_ROOM), np.empty(_ROOM, np.int64)), 1
    queue[0][0], queue[1][0] = 0.0, (x * sy + y) * sz + z
    while size > 0:
        spent, node, size = queue[0][0], queue[1][0], size - 1
        pop(queue, size)
        if size + _MOST_MOVES > queue[0].shape[0]:
            queue = grown(queue)
        i, j, k = node // (sy * sz), node // sz % sy, node % sz
        if spent > left[i, j, k]:
            continue
        for a in range(max(i - 1, 0), min(i + 2, sx)):
            for b in range(max(j - 1, 0), min(j + 2, sy)):
                for c in range(max(k - 1, 0), min(k + 2, sz)):
                    length = lengths[(a - i) ** 2 + (b - j) ** 2 + (c - k) ** 2]
                    total = spent + 0.5 * length * (price[i, j, k] + price[a, b, c])
                    if total < left[a, b, c]:
                        left[a, b, c] = total
                        push(queue, size, total, (a * sy + b) * sz + c)
                        size += 1
    return left


@kernel()
def raise_prices(prices, path, reach, factor):
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
