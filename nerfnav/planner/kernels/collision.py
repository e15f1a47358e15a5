"""The collision and control terms of Eq. 2 with their derivatives: twin of planner/costs.py.

Body point b travels from x = p_t + R_t b to y = p_{t+1} + R_{t+1} b; s = |y - x|. Densities are taken at
x + f (y - x) for each fraction f, and their mean counts s times.
"""

import math

from nerfnav.compiled import kernel

STANDSTILL = 1e-12
"""Squared distance [m^2] that keeps the derivative of a distance finite where nothing moves."""


@kernel()
def spread(position, rotation, points_body, fractions, world, samples):
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
                    way = world[t + 1, b, axis] - world[t, b, axis]
                    samples[t, b, k, axis] = world[t, b, axis] + fractions[k] * way


@kernel()
def collision(rotation, points_body, fractions, world, density, slope, weight, by_position, by_rotation):
    """`weight` times the collision term; adds its derivatives by position and attitude (in its tangent).

    density (N, B, K) [1/m] and slope (N, B, K, 3), its gradient, belong to the samples of `spread`.
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
                    way = (world[t + 1, b, axis] - world[t, b, axis]) / travelled
                    part = met * (way if end == 1 else -way)
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
