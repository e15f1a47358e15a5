"""The differential drive's flatness map, its limits and its adjoint in scalars: twin of robots/diffdrive.py.

`ends` (2, 5) are x, y, heading, forward speed and yaw rate of the start and the goal. Derivatives by attitude are
vectors in its body tangent, of which a differential drive uses z.
"""

import math

import numpy as np

from nerfnav.core.jit import kernel
from nerfnav.robots.kernels.arcs import chords, path, pull, through_closing
from nerfnav.robots.kernels.hinges import over


@kernel()
def motion(numbers, ends, last, dt, speeds, position, velocity, rotation, rate, action):
    """Fill speeds (N+1), position, velocity and rate (N+1, 3), rotation (N+1, 3, 3) and action (N, 2).

    `numbers` are free numbers that lead to the goal. Heights, and velocity at time 0, are left as they are.
    """
    steps = action.shape[0]
    yaw = np.empty(steps + 1)
    path(numbers, ends, last, dt, speeds, yaw)
    rate[:], rotation[:] = 0.0, 0.0
    position[0, 0], position[0, 1] = ends[0, 0], ends[0, 1]
    for t in range(steps):
        chord, _, _ = chords(yaw[t + 1] - yaw[t])
        middle = 0.5 * (yaw[t] + yaw[t + 1])
        position[t + 1, 0] = position[t, 0] + speeds[t] * dt * chord * math.cos(middle)
        position[t + 1, 1] = position[t, 1] + speeds[t] * dt * chord * math.sin(middle)
        rate[t, 2] = (yaw[t + 1] - yaw[t]) / dt
    rate[steps, 2] = ends[1, 4]
    for t in range(steps + 1):
        cosine, sine = math.cos(yaw[t]), math.sin(yaw[t])
        rotation[t, 0, 0], rotation[t, 0, 1] = cosine, -sine
        rotation[t, 1, 0], rotation[t, 1, 1], rotation[t, 2, 2] = sine, cosine, 1.0
        if t > 0:
            velocity[t, 0], velocity[t, 1] = speeds[t] * cosine, speeds[t] * sine
    for t in range(steps):
        action[t, 0], action[t, 1] = (speeds[t + 1] - speeds[t]) / dt, (rate[t + 1, 2] - rate[t, 2]) / dt


@kernel()
def limits(speeds, rate, action, bounds, weight, by_speed, by_rate, by_action):
    """`weight` times the penalty on speed, yaw rate and both accelerations beyond `bounds`; adds its derivatives.

    by_speed and by_rate (N+1), by_action (N, 2).
    """
    total = 0.0
    for t in range(speeds.shape[0]):
        total += over(speeds[t], bounds[0], weight, by_speed, t) + over(rate[t, 2], bounds[1], weight, by_rate, t)
    for t in range(action.shape[0]):
        for axis in range(2):
            total += over(action[t, axis], bounds[2 + axis], weight, by_action[t], axis)
    return total


@kernel()
def adjoint(iterates, rounds, ends, last, dt, by_position, by_rotation, by_speed, by_rate, by_action, gradient):
    """Turn the derivatives of a cost into `gradient`, its derivative by the free numbers; uses them up as scratch.

    `iterates` are those of `close`, of which so many `rounds` were made.
    """
    steps = by_action.shape[0]
    speeds, yaw = np.empty(steps + 1), np.empty(steps + 1)
    path(iterates[rounds], ends, last, dt, speeds, yaw)
    for t in range(steps):
        by_speed[t + 1] += by_action[t, 0] / dt
        by_speed[t] -= by_action[t, 0] / dt
        by_rate[t + 1] += by_action[t, 1] / dt
        by_rate[t] -= by_action[t, 1] / dt
    for t in range(steps):
        by_rotation[t + 1, 2] += by_rate[t] / dt
        by_rotation[t, 2] -= by_rate[t] / dt
    x, y = 0.0, 0.0
    for t in range(steps - 1, -1, -1):
        x += by_position[t + 1, 0]
        y += by_position[t + 1, 1]
        faster, turned, after = pull(speeds, yaw, dt, t, x, y)
        by_speed[t] += faster
        by_rotation[t, 2] += turned
        by_rotation[t + 1, 2] += after
    for t in range(1, steps):
        gradient[t - 1] = by_speed[t]
    for t in range(2, steps):
        gradient[steps - 3 + t] = by_rotation[t, 2]
    through_closing(iterates, rounds, ends, last, dt, gradient)
