"""The risk term with its derivative: twin of planner/terms/risk.py.

The chance of a collision is trilinear between the nodes of a grid, one for each of the first steps and for all later
ones, and 0 outside of it.
"""

import math

from nerfnav.compiled import kernel
from nerfnav.planner.kernels.collision import STANDSTILL


@kernel(inline=True)
def chance_at(danger, step, x, y, z):
    """The chance at a point of the world in a step, and its gradient [1/m]."""
    layers, lower, per_meter = danger
    chances = layers[min(step, layers.shape[0] - 1)]
    nx, ny, nz = chances.shape
    x, y, z = (x - lower[0]) * per_meter[0], (y - lower[1]) * per_meter[1], (z - lower[2]) * per_meter[2]
    if not (0.0 <= x <= nx - 1 and 0.0 <= y <= ny - 1 and 0.0 <= z <= nz - 1):
        return 0.0, 0.0, 0.0, 0.0
    i, j, k = min(int(x), nx - 2), min(int(y), ny - 2), min(int(z), nz - 2)
    x, y, z = x - i, y - j, z - k
    edge00, slope00 = chances[i, j, k], chances[i, j, k + 1] - chances[i, j, k]
    edge01, slope01 = chances[i, j + 1, k], chances[i, j + 1, k + 1] - chances[i, j + 1, k]
    edge10, slope10 = chances[i + 1, j, k], chances[i + 1, j, k + 1] - chances[i + 1, j, k]
    edge11, slope11 = chances[i + 1, j + 1, k], chances[i + 1, j + 1, k + 1] - chances[i + 1, j + 1, k]
    edge00, edge01 = edge00 + z * slope00, edge01 + z * slope01
    edge10, edge11 = edge10 + z * slope10, edge11 + z * slope11
    near, far = edge00 + y * (edge01 - edge00), edge10 + y * (edge11 - edge10)
    along_y = (1.0 - x) * (edge01 - edge00) + x * (edge11 - edge10)
    along_z = (1.0 - x) * ((1.0 - y) * slope00 + y * slope01) + x * ((1.0 - y) * slope10 + y * slope11)
    return near + x * (far - near), per_meter[0] * (far - near), per_meter[1] * along_y, per_meter[2] * along_z


@kernel()
def endangered(position, fractions, danger, by_way, weight, by_position):
    """`weight` times the risk term of positions (N + 1, 3); adds its derivative.

    With `by_way` [1/m] above 0, a step counts by its way times that, else once.
    """
    total, parts = 0.0, fractions.shape[0]
    for t in range(position.shape[0] - 1):
        x, y, z = position[t, 0], position[t, 1], position[t, 2]
        dx, dy, dz = position[t + 1, 0] - x, position[t + 1, 1] - y, position[t + 1, 2] - z
        met = sx = sy = sz = tx = ty = tz = 0.0
        for k in range(parts):
            f = fractions[k]
            chance, gx, gy, gz = chance_at(danger, t, x + f * dx, y + f * dy, z + f * dz)
            met += chance / parts
            sx, sy, sz = sx + gx / parts, sy + gy / parts, sz + gz / parts
            tx, ty, tz = tx + f * gx / parts, ty + f * gy / parts, tz + f * gz / parts
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
    return total
