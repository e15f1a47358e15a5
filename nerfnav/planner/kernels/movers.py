"""Kernels of plans among announced movers: distances from their boxes, the cost of coming near, and timing of a path.

Movers are boxes at given times: `centers` (n, m, 3) [m], `axes` (m, 3, 3), whose rows are each box's axes in the world,
and `halves` (m, 3) [m], which the robot's have enlarged: the robot itself is a point then.
"""

import math

import numpy as np

from nerfnav.core.jit import kernel

_NOWHERE = 1e30


@kernel()
def _box_distance(dx, dy, dz, axes, halves):
    """Signed distance of a point from a box, from the offset to its centre, with its gradient in the world."""
    farthest, inside, squared = -_NOWHERE, 0, 0.0
    gx, gy, gz = 0.0, 0.0, 0.0
    for i in range(3):
        along = axes[i, 0] * dx + axes[i, 1] * dy + axes[i, 2] * dz
        gap = abs(along) - halves[i]
        if gap > farthest:
            farthest, inside = gap, i
        if gap > 0.0:
            squared += gap * gap
            signed = gap if along > 0.0 else -gap
            gx, gy, gz = gx + signed * axes[i, 0], gy + signed * axes[i, 1], gz + signed * axes[i, 2]
    if squared > 0.0:
        distance = math.sqrt(squared)
        return distance, gx / distance, gy / distance, gz / distance
    along = axes[inside, 0] * dx + axes[inside, 1] * dy + axes[inside, 2] * dz
    sign = 1.0 if along >= 0.0 else -1.0
    return farthest, sign * axes[inside, 0], sign * axes[inside, 1], sign * axes[inside, 2]


@kernel()
def box_gaps(points, centers, axes, halves, gaps):
    """Fill `gaps` (n, m): signed distances of points (n, 3), each at a time of its own, from all boxes."""
    for n in range(points.shape[0]):
        for m in range(halves.shape[0]):
            gaps[n, m] = _box_distance(
                points[n, 0] - centers[n, m, 0], points[n, 1] - centers[n, m, 1], points[n, 2] - centers[n, m, 2],
                axes[m], halves[m],
            )[0]  # fmt: skip


@kernel()
def cover(points, centers, axes, halves, margin, covered):
    """Mark in `covered` (n, S) the points (S, 3) that are nearer than `margin` [m] to a box at each of n times."""
    for n in range(centers.shape[0]):
        for s in range(points.shape[0]):
            covered[n, s] = False
            for m in range(halves.shape[0]):
                distance = _box_distance(
                    points[s, 0] - centers[n, m, 0], points[s, 1] - centers[n, m, 1], points[s, 2] - centers[n, m, 2],
                    axes[m], halves[m],
                )[0]  # fmt: skip
                if distance < margin:
                    covered[n, s] = True
                    break


@kernel()
def nearness(position, fractions, boxes, deviation, depth, weight, by_position):
    """`weight` times the cost of positions (N + 1, 3) near movers; adds its derivative.

        sum_t mean_k sum_m  P(d < noise) + (min(d, 0) / depth)^2,   noise ~ N(0, deviation^2)

    The boxes' centers (N, K, m, 3) are those at each of the K fractions of the N steps, beside axes and halves.
    """
    centers, axes, halves = boxes
    total, parts = 0.0, fractions.shape[0]
    share = weight / parts
    for t in range(position.shape[0] - 1):
        for k in range(parts):
            f = fractions[k]
            x = position[t, 0] + f * (position[t + 1, 0] - position[t, 0])
            y = position[t, 1] + f * (position[t + 1, 1] - position[t, 1])
            z = position[t, 2] + f * (position[t + 1, 2] - position[t, 2])
            for m in range(halves.shape[0]):
                d, gx, gy, gz = _box_distance(
                    x - centers[t, k, m, 0], y - centers[t, k, m, 1], z - centers[t, k, m, 2], axes[m], halves[m]
                )
                at = d / deviation
                if at > 6.0:
                    continue
                inside = min(d, 0.0) / depth
                total += share * (0.5 * math.erfc(at / math.sqrt(2.0)) + inside * inside)
                slope = 2.0 * inside / depth - math.exp(-0.5 * at * at) / (deviation * math.sqrt(2.0 * math.pi))
                slope *= share
                gradient = (slope * gx, slope * gy, slope * gz)
                for axis in range(3):
                    by_position[t, axis] += (1.0 - f) * gradient[axis]
                    by_position[t + 1, axis] += f * gradient[axis]
    return total


@kernel()
def time_path(blocked, first, most, gain, places):
    """Find how far along a path to be at each time, without being at a blocked place; write it to `places` (N + 1).

    `blocked` (2 N + 1, S) says for each half step in time which of the S points of the path a mover covers. From one
    time to the next the robot moves on by 0 to `most` points, and by at most `gain` more or fewer than before. The sum
    of squared changes of these moves is least, beginning with a move of `first` points and ending at rest at the last
    point. Returns that cost, 1e30 where there is no way.
    """
    steps, count = places.shape[0] - 1, blocked.shape[1]
    moves = most + 1
    cost = np.full((count, moves), _NOWHERE)
    before = np.zeros((steps + 1, count, moves), np.int16)
    cost[0, min(first, most)] = 0.0
    for k in range(steps):
        after = np.full((count, moves), _NOWHERE)
        for s in range(count):
            for d in range(moves):
                here = cost[s, d]
                if here >= _NOWHERE:
                    continue
                for e in range(max(0, d - gain), min(most, d + gain) + 1):
                    at = s + e
                    if at >= count:
                        break
                    if blocked[2 * k + 2, at] or blocked[2 * k + 1, s + e // 2]:
                        continue
                    found = here + (e - d) ** 2
                    if found < after[at, e]:
                        after[at, e] = found
                        before[k + 1, at, e] = d
        cost = after
    last = 0
    for d in range(moves):
        if cost[count - 1, d] + d * d < cost[count - 1, last] + last * last:
            last = d
    best, at, move = cost[count - 1, last], count - 1, last
    if best >= _NOWHERE:
        return _NOWHERE
    for k in range(steps, 0, -1):
        places[k] = at
        move, at = before[k, at, move], at - move
    places[0] = at
    return best
