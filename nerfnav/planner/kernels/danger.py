"""The risk term with its derivative: twin of planner/terms/risk.py.

The chance of a collision is trilinear between the nodes of a grid, linear between headings where there are several, and
0 outside of the grid; one grid for each of the first steps and one for all later ones.
"""

import math

from nerfnav.compiled import kernel
from nerfnav.planner.kernels.collision import STANDSTILL


@kernel(inline=True)
def _between(chances, i, j, k, x, y, z):
    """The chance at a place in the cell (i, j, k), and its gradient [1 / node]."""
    edge00, slope00 = chances[i, j, k], chances[i, j, k + 1] - chances[i, j, k]
    edge01, slope01 = chances[i, j + 1, k], chances[i, j + 1, k + 1] - chances[i, j + 1, k]
    edge10, slope10 = chances[i + 1, j, k], chances[i + 1, j, k + 1] - chances[i + 1, j, k]
    edge11, slope11 = chances[i + 1, j + 1, k], chances[i + 1, j + 1, k + 1] - chances[i + 1, j + 1, k]
    edge00, edge01 = edge00 + z * slope00, edge01 + z * slope01
    edge10, edge11 = edge10 + z * slope10, edge11 + z * slope11
    near, far = edge00 + y * (edge01 - edge00), edge10 + y * (edge11 - edge10)
    along_y = (1.0 - x) * (edge01 - edge00) + x * (edge11 - edge10)
    along_z = (1.0 - x) * ((1.0 - y) * slope00 + y * slope01) + x * ((1.0 - y) * slope10 + y * slope11)
    return near + x * (far - near), far - near, along_y, along_z


@kernel(inline=True)
def chance_at(danger, step, x, y, z, heading):
    """The chance at a point of the world with a heading in a step, its gradient [1/m], and by the heading [1/rad]."""
    layers, lower, per_meter = danger
    chances = layers[min(step, layers.shape[0] - 1)]
    headings, nx, ny, nz = chances.shape
    x, y, z = (x - lower[0]) * per_meter[0], (y - lower[1]) * per_meter[1], (z - lower[2]) * per_meter[2]
    if not (0.0 <= x <= nx - 1 and 0.0 <= y <= ny - 1 and 0.0 <= z <= nz - 1):
        return 0.0, 0.0, 0.0, 0.0, 0.0
    i, j, k = min(int(x), nx - 2), min(int(y), ny - 2), min(int(z), nz - 2)
    x, y, z = x - i, y - j, z - k
    if headings == 1:
        chance, gx, gy, gz = _between(chances[0], i, j, k, x, y, z)
        return chance, per_meter[0] * gx, per_meter[1] * gy, per_meter[2] * gz, 0.0
    at = heading / math.pi % 1.0 * headings
    below = min(int(at), headings - 1)
    rest, above = at - below, (below + 1) % headings
    first, ax, ay, az = _between(chances[below], i, j, k, x, y, z)
    second, bx, by, bz = _between(chances[above], i, j, k, x, y, z)
    gx, gy, gz = ax + rest * (bx - ax), ay + rest * (by - ay), az + rest * (bz - az)
    by_heading = (second - first) * headings / math.pi
    return first + rest * (second - first), per_meter[0] * gx, per_meter[1] * gy, per_meter[2] * gz, by_heading


@kernel(inline=True)
def _heading(rotation):
    """Where the x axis of R points, seen from above [rad]."""
    return math.atan2(rotation[1, 0], rotation[0, 0])


@kernel(inline=True)
def _through_heading(rotation, by_heading, by_tangent):
    """Add what a derivative by the heading is in the tangent of R."""
    x, y = rotation[0, 0], rotation[1, 0]
    share = by_heading / max(x * x + y * y, STANDSTILL)
    by_tangent[1] -= share * (x * rotation[1, 2] - y * rotation[0, 2])
    by_tangent[2] += share * (x * rotation[1, 1] - y * rotation[0, 1])


@kernel()
def endangered(position, rotation, fractions, danger, by_way, weight, by_position, by_rotation):
    """`weight` times the risk term of positions (N + 1, 3) and attitudes (N + 1, 3, 3); adds its derivatives.

    With `by_way` [1/m] above 0, a step counts by its way times that, else once.
    """
    total, parts, turns = 0.0, fractions.shape[0], danger[0].shape[1] > 1
    heading, turn = 0.0, 0.0
    for t in range(position.shape[0] - 1):
        x, y, z = position[t, 0], position[t, 1], position[t, 2]
        dx, dy, dz = position[t + 1, 0] - x, position[t + 1, 1] - y, position[t + 1, 2] - z
        if turns:
            heading = _heading(rotation[t])
            turn = (_heading(rotation[t + 1]) - heading + math.pi) % (2.0 * math.pi) - math.pi
        met = sx = sy = sz = sh = tx = ty = tz = th = 0.0
        for k in range(parts):
            f = fractions[k]
            chance, gx, gy, gz, gh = chance_at(danger, t, x + f * dx, y + f * dy, z + f * dz, heading + f * turn)
            met += chance / parts
            sx, sy, sz, sh = sx + gx / parts, sy + gy / parts, sz + gz / parts, sh + gh / parts
            tx, ty, tz, th = tx + f * gx / parts, ty + f * gy / parts, tz + f * gz / parts, th + f * gh / parts
        if met == 0.0:
            continue
        times, along = weight, 0.0
        if by_way > 0.0:
            travelled = math.sqrt(STANDSTILL + dx * dx + dy * dy + dz * dz)
            times, along = weight * by_way * travelled, weight * by_way * met / travelled
        total += times * met
        last = (times * tx + along * dx, times * ty + along * dy, times * tz + along * dz)
        by_position[t, 0] += times * sx - last[0]
        by_position[t, 1] += times * sy - last[1]
        by_position[t, 2] += times * sz - last[2]
        for axis in range(3):
            by_position[t + 1, axis] += last[axis]
        if turns:
            _through_heading(rotation[t], times * (sh - th), by_rotation[t])
            _through_heading(rotation[t + 1], times * th, by_rotation[t + 1])
    return total
