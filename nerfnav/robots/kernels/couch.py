"""The couch's flatness map, its limits and its adjoint in scalars: twin of robots/couch.py.

`ends` (2, 6) are x, y, their velocities, heading and yaw rate of the start and the goal; `constants` are mass,
inertia about z, dt and height. Derivatives by attitude are vectors in its body tangent, of which a couch uses z.
"""

import math

import numpy as np

from nerfnav.core.jit import kernel
from nerfnav.robots.kernels.hinges import over, over_in_plane


@kernel()
def motion(free, ends, constants, position, velocity, rotation, rate, action):
    """Fill position, velocity and rate (N+1, 3), rotation (N+1, 3, 3) and action (N, 3)."""
    steps = action.shape[0]
    mass, inertia, dt, height = constants
    inner = steps - 2
    yaw = np.empty(steps + 1)
    yaw[0], yaw[1], yaw[steps] = ends[0, 4], ends[0, 4] + ends[0, 5] * dt, ends[1, 4]
    for t in range(2, steps):
        yaw[t] = free[2 * inner + t - 2]
    velocity[:], rate[:], rotation[:] = 0.0, 0.0, 0.0
    for axis in range(2):
        position[0, axis], position[steps, axis] = ends[0, axis], ends[1, axis]
        position[1, axis] = ends[0, axis] + ends[0, 2 + axis] * dt
        for t in range(2, steps):
            position[t, axis] = free[2 * (t - 2) + axis]
        velocity[0, axis], velocity[steps, axis] = ends[0, 2 + axis], ends[1, 2 + axis]
        for t in range(1, steps):
            velocity[t, axis] = (position[t + 1, axis] - position[t, axis]) / dt
        for t in range(steps):
            action[t, axis] = mass * (velocity[t + 1, axis] - velocity[t, axis]) / dt
    rate[0, 2], rate[steps, 2] = ends[0, 5], ends[1, 5]
    for t in range(1, steps):
        turn = yaw[t + 1] - yaw[t]
        rate[t, 2] = math.atan2(math.sin(turn), math.cos(turn)) / dt
    for t in range(steps):
        action[t, 2] = inertia * (rate[t + 1, 2] - rate[t, 2]) / dt
    for t in range(steps + 1):
        position[t, 2] = height
        cosine, sine = math.cos(yaw[t]), math.sin(yaw[t])
        rotation[t, 0, 0], rotation[t, 0, 1] = cosine, -sine
        rotation[t, 1, 0], rotation[t, 1, 1], rotation[t, 2, 2] = sine, cosine, 1.0


@kernel()
def limits(velocity, rate, action, bounds, weight, by_velocity, by_rate, by_action):
    """`weight` times the penalty on speed, yaw rate and force beyond `bounds`; adds its derivatives.

    by_velocity (N+1, 2) in the plane, by_rate (N+1) about z, by_action (N, 3).
    """
    total = 0.0
    for t in range(velocity.shape[0]):
        total += over_in_plane(velocity[t, 0], velocity[t, 1], bounds[0], weight, by_velocity[t])
        total += over(rate[t, 2], bounds[1], weight, by_rate, t)
    for t in range(action.shape[0]):
        total += over_in_plane(action[t, 0], action[t, 1], bounds[2], weight, by_action[t])
    return total


@kernel()
def adjoint(constants, by_position, by_rotation, by_velocity, by_rate, by_action, gradient):
    """Turn the derivatives of a cost into `gradient`, its derivative by the free numbers; uses them up as scratch."""
    steps = by_action.shape[0]
    mass, inertia, dt = constants[0], constants[1], constants[2]
    inner = steps - 2
    for t in range(steps):
        for axis in range(2):
            push = mass / dt * by_action[t, axis]
            by_velocity[t + 1, axis] += push
            by_velocity[t, axis] -= push
        twist = inertia / dt * by_action[t, 2]
        by_rate[t + 1] += twist
        by_rate[t] -= twist
    for t in range(1, steps):
        for axis in range(2):
            by_position[t + 1, axis] += by_velocity[t, axis] / dt
            by_position[t, axis] -= by_velocity[t, axis] / dt
        by_rotation[t + 1, 2] += by_rate[t] / dt
        by_rotation[t, 2] -= by_rate[t] / dt
    for t in range(2, steps):
        gradient[2 * (t - 2)], gradient[2 * (t - 2) + 1] = by_position[t, 0], by_position[t, 1]
        gradient[2 * inner + t - 2] = by_rotation[t, 2]
