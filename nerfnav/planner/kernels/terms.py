"""Terms of J with their derivatives: twins of risk/costs.py, terms/risk.py, terms/delay.py and of `outside` in
space/border.py.

Collision: body point b travels from x = p_t + R_t b to y = p_{t+1} + R_{t+1} b; s = |y - x|. Densities are taken at
x + f (y - x) for each fraction f, and their mean counts s times.

Risk: the chance of a collision is trilinear between the nodes of a grid, linear between headings where there are
several, and 0 outside of the grid; one grid for each of the first steps and one for all later ones.
"""

import math

from nerfnav.core.jit import kernel

SMOOTH = 1e-4
"""Added to the square of what a unit vector has along an axis, so that its absolute value has no kink."""


@kernel()
def outside(position, rotation, space, weight, by_position, by_rotation):
    """`weight` times the penalty; adds its derivatives by position and attitude (in its tangent).

    `space` is (lower and upper corner of the box, half edges of the body).
    """
    lower, upper, half = space
    farthest, total = (half[0] + half[1] + half[2]) * math.sqrt(1.0 + SMOOTH), 0.0
    for t in range(rotation.shape[0]):
        for axis in range(3):
            at = position[t, axis]
            if lower[axis] + farthest <= at <= upper[axis] - farthest:
                continue
            x, y, z = rotation[t, axis, 0], rotation[t, axis, 1], rotation[t, axis, 2]
            along_x, along_y, along_z = math.sqrt(x * x + SMOOTH), math.sqrt(y * y + SMOOTH), math.sqrt(z * z + SMOOTH)
            reach = half[0] * along_x + half[1] * along_y + half[2] * along_z
            below, above = max(lower[axis] - at + reach, 0.0), max(at + reach - upper[axis], 0.0)
            total += weight * (below * below + above * above)
            by_position[t, axis] += 2.0 * weight * (above - below)
            pull = 2.0 * weight * (above + below)
            by_x, by_y, by_z = half[0] * x / along_x, half[1] * y / along_y, half[2] * z / along_z
            by_rotation[t, 0] += pull * (z * by_y - y * by_z)
            by_rotation[t, 1] += pull * (x * by_z - z * by_x)
            by_rotation[t, 2] += pull * (y * by_x - x * by_y)
    return total


NEAR = 0.05
"""Distance from the goal below which the price of arriving later falls with its square [m]: about the deviation by
noise."""


@kernel()
def delay(position, weight, by_position):
    """`weight` times the distances of positions (N + 1, 3) from the last one; adds its derivative."""
    total, last = 0.0, position.shape[0] - 1
    for t in range(last):
        x, y, z = (
            position[t, 0] - position[last, 0], position[t, 1] - position[last, 1], position[t, 2] - position[last, 2],
        )  # fmt: skip
        distance = math.sqrt(x * x + y * y + z * z + NEAR * NEAR)
        slope = weight / distance
        by_position[t, 0] += slope * x
        by_position[t, 1] += slope * y
        by_position[t, 2] += slope * z
        by_position[last, 0] -= slope * x
        by_position[last, 1] -= slope * y
        by_position[last, 2] -= slope * z
        total += weight * (distance - NEAR)
    return total


STANDSTILL = 1e-12
"""Squared distance [m^2] that keeps the derivative of a distance finite where nothing moves."""


@kernel()
def place_points(position, rotation, points_body, fractions, world, samples):
    """Fill world (N + 1, B, 3), the body points, and samples (N, B, K, 3), where densities are to be taken."""
    times, count = world.shape[0], world.shape[1]
    for t in range(times):
        for b in range(count):
            for axis in range(3):
                world[t, b, axis] = (
                    position[t, axis]
                    + rotation[t, axis, 0] * points_body[b, 0]
                    + rotation[t, axis, 1] * points_body[b, 1]
                    + rotation[t, axis, 2] * points_body[b, 2]
                )
    for t in range(times - 1):
        for b in range(count):
            for k in range(fractions.shape[0]):
                for axis in range(3):
                    moved = world[t + 1, b, axis] - world[t, b, axis]
                    samples[t, b, k, axis] = world[t, b, axis] + fractions[k] * moved


@kernel()
def collision(rotation, points_body, fractions, world, density, slope, weight, by_position, by_rotation):
    """`weight` times the collision term; adds its derivatives by position and attitude (in its tangent).

    density (N, B, K) [1/m] and slope (N, B, K, 3), its gradient, belong to the samples of `place_points`.
    """
    total = 0.0
    steps, count, parts = density.shape
    for t in range(steps):
        for b in range(count):
            met = 0.0
            for k in range(parts):
                met += density[t, b, k] / parts
            squared = STANDSTILL
            for axis in range(3):
                squared += (world[t + 1, b, axis] - world[t, b, axis]) ** 2
            travelled = math.sqrt(squared)
            total += weight * met * travelled
            if met == 0.0:
                continue
            for end in range(2):
                by = (0.0, 0.0, 0.0)
                for axis in range(3):
                    moved = (world[t + 1, b, axis] - world[t, b, axis]) / travelled
                    part = met * (moved if end == 1 else -moved)
                    for k in range(parts):
                        share = fractions[k] if end == 1 else 1.0 - fractions[k]
                        part += travelled * share * slope[t, b, k, axis] / parts
                    part *= weight
                    by_position[t + end, axis] += part
                    row = rotation[t + end, axis]
                    by = (by[0] + part * row[0], by[1] + part * row[1], by[2] + part * row[2])
                x, y, z = points_body[b, 0], points_body[b, 1], points_body[b, 2]
                by_rotation[t + end, 0] += y * by[2] - z * by[1]
                by_rotation[t + end, 1] += z * by[0] - x * by[2]
                by_rotation[t + end, 2] += x * by[1] - y * by[0]
    return total


@kernel()
def control(action, gamma, by_action):
    """sum_t u_t' Gamma u_t; adds its derivative by the actions."""
    total = 0.0
    for t in range(action.shape[0]):
        for a in range(action.shape[1]):
            total += gamma[a] * action[t, a] ** 2
            by_action[t, a] += 2.0 * gamma[a] * action[t, a]
    return total


@kernel()
def _between(chances, i, j, k, x, y, z):
    """Interpolate the chance in the cell (i, j, k), and its gradient [1 / node]."""
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


@kernel()
def interpolate_chance(grid, step, x, y, z, heading):
    """Interpolate the chance above the accepted one at a point of the world with a heading in a step, its gradient
    [1/m], and by the heading [1/rad]."""
    layers, lower, per_meter, accepted = grid
    chances = layers[min(step, layers.shape[0] - 1)]
    headings, nx, ny, nz = chances.shape
    x, y, z = (x - lower[0]) * per_meter[0], (y - lower[1]) * per_meter[1], (z - lower[2]) * per_meter[2]
    if not (0.0 <= x <= nx - 1 and 0.0 <= y <= ny - 1 and 0.0 <= z <= nz - 1):
        return 0.0, 0.0, 0.0, 0.0, 0.0
    i, j, k = min(int(x), nx - 2), min(int(y), ny - 2), min(int(z), nz - 2)
    x, y, z = x - i, y - j, z - k
    if headings == 1:
        chance, gx, gy, gz = _between(chances[0], i, j, k, x, y, z)
        if chance <= accepted:
            return 0.0, 0.0, 0.0, 0.0, 0.0
        return chance - accepted, per_meter[0] * gx, per_meter[1] * gy, per_meter[2] * gz, 0.0
    at = heading / math.pi % 1.0 * headings
    below = min(int(at), headings - 1)
    rest, above = at - below, (below + 1) % headings
    first, ax, ay, az = _between(chances[below], i, j, k, x, y, z)
    second, bx, by, bz = _between(chances[above], i, j, k, x, y, z)
    gx, gy, gz = ax + rest * (bx - ax), ay + rest * (by - ay), az + rest * (bz - az)
    chance, by_heading = first + rest * (second - first), (second - first) * headings / math.pi
    if chance <= accepted:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    return chance - accepted, per_meter[0] * gx, per_meter[1] * gy, per_meter[2] * gz, by_heading


@kernel()
def _heading(rotation):
    """Return the heading of the x axis of R, seen from above [rad]."""
    return math.atan2(rotation[1, 0], rotation[0, 0])


@kernel()
def _through_heading(rotation, by_heading, by_tangent):
    """Add what a derivative by the heading is in the tangent of R."""
    x, y = rotation[0, 0], rotation[1, 0]
    share = by_heading / max(x * x + y * y, STANDSTILL)
    by_tangent[1] -= share * (x * rotation[1, 2] - y * rotation[0, 2])
    by_tangent[2] += share * (x * rotation[1, 1] - y * rotation[0, 1])


@kernel()
def risk(position, rotation, fractions, grid, by_distance, weight, by_position, by_rotation):
    """`weight` times the risk term of positions (N + 1, 3) and attitudes (N + 1, 3, 3); adds its derivatives.

    With `by_distance` [1/m] above 0, a step counts by its length times that, else once.
    """
    total, parts, turns = 0.0, fractions.shape[0], grid[0].shape[1] > 1
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
            chance, gx, gy, gz, gh = interpolate_chance(
                grid, t, x + f * dx, y + f * dy, z + f * dz, heading + f * turn
            )
            met += chance / parts
            sx, sy, sz, sh = sx + gx / parts, sy + gy / parts, sz + gz / parts, sh + gh / parts
            tx, ty, tz, th = tx + f * gx / parts, ty + f * gy / parts, tz + f * gz / parts, th + f * gh / parts
        if met == 0.0:
            continue
        times, along = weight, 0.0
        if by_distance > 0.0:
            travelled = math.sqrt(STANDSTILL + dx * dx + dy * dy + dz * dz)
            times, along = weight * by_distance * travelled, weight * by_distance * met / travelled
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
