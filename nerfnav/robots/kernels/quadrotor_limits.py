"""The quadrotor's limits and their derivatives: twin of `Quadrotor.limits` and of autograd through it.

Each term is a squared excess over a bound, as a share of the bound. Derivatives by attitude R are vectors g in its
body tangent: R -> R Exp(delta) changes the cost by g . delta.
"""

import math

import numpy as np

from nerfnav.compiled import kernel
from nerfnav.robots.kernels.rotations import inverse_left_jacobian


@kernel()
def limits(velocity, rotation, rate, action, bounds, weight, dt, by_position, by_rotation, by_action):
    """`weight` times the penalty; adds its derivatives by position, attitude and action.

    `bounds` are the weight [N], the least upward thrust as a share of it, the largest thrust [N], tilt [rad], speed
    [m/s] and body rate [rad/s]. Velocities and rates between the ends stand for positions and attitudes.
    """
    steps = action.shape[0]
    total = 0.0
    for t in range(steps):
        total += _thrust(rotation[t], action[t, 0], bounds, weight, by_rotation[t], by_action[t])
    for t in range(steps + 1):
        total += _tilt(rotation[t], bounds[3], weight, by_rotation[t])
        moving = 0 < t < steps
        size = _length(velocity[t])
        excess = size / bounds[4] - 1.0
        if excess > 0.0:
            total += weight * excess * excess
            if moving:
                slope = 2.0 * weight * excess / (bounds[4] * size * dt)
                for axis in range(3):
                    by_position[t + 1, axis] += slope * velocity[t, axis]
                    by_position[t, axis] -= slope * velocity[t, axis]
        size = _length(rate[t])
        excess = size / bounds[5] - 1.0
        if excess > 0.0:
            total += weight * excess * excess
            if moving:
                slope = 2.0 * weight * excess / (bounds[5] * size)
                _through_rate(rate[t], slope, dt, by_rotation[t], by_rotation[t + 1])
    return total


@kernel(inline=True)
def _thrust(rotation, thrust, bounds, weight, by_rotation, by_action):
    """The penalties on too little upward thrust and on too much of it."""
    carried, floor, most = bounds[0], bounds[1], bounds[2]
    total = 0.0
    up = rotation[2]  # the world's z axis in the body
    missing = floor - thrust * up[2] / carried
    if missing > 0.0:
        total += weight * missing * missing
        slope = -2.0 * weight * missing / carried
        by_action[0] += slope * up[2]
        # d (e3' R Exp(delta) e3) = delta . (e3 x R' e3)
        by_rotation[0] -= slope * thrust * up[1]
        by_rotation[1] += slope * thrust * up[0]
    excess = thrust / most - 1.0
    if excess > 0.0:
        total += weight * excess * excess
        by_action[0] += 2.0 * weight * excess / most
    return total


@kernel(inline=True)
def _length(vector):
    return math.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)


@kernel(inline=True)
def _tilt(rotation, most, weight, by_tangent):
    """The penalty on the angle between the body's z axis n and the vertical, atan2(|n_xy|, n_z)."""
    x, y, z = rotation[0, 2], rotation[1, 2], rotation[2, 2]
    across = math.sqrt(x * x + y * y)
    excess = math.atan2(across, z) / most - 1.0
    if not excess > 0.0:
        return 0.0
    slope = 2.0 * weight * excess / most / (across * across + z * z)
    by_x, by_y, by_z = slope * z * x / max(across, 1e-9), slope * z * y / max(across, 1e-9), -slope * across
    # dn = R (delta x e3)
    by_tangent[1] += by_x * rotation[0, 0] + by_y * rotation[1, 0] + by_z * rotation[2, 0]
    by_tangent[0] -= by_x * rotation[0, 1] + by_y * rotation[1, 1] + by_z * rotation[2, 1]
    return weight * excess * excess


@kernel(inline=True)
def _through_rate(rate, slope, dt, by_before, by_after):
    """Derivatives by two attitudes of a cost whose derivative by w = Log(R' R+) / dt is slope w."""
    theta, by_rate, forward, backward = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for axis in range(3):
        theta[axis], by_rate[axis] = rate[axis] * dt, slope * rate[axis]
    # d theta = Jr^-1 delta+ - Jl^-1 delta, and the transpose of Jr^-1 is Jl^-1
    inverse_left_jacobian(theta, 1.0, by_rate, forward)
    inverse_left_jacobian(theta, -1.0, by_rate, backward)
    for axis in range(3):
        by_after[axis] += forward[axis] / dt
        by_before[axis] -= backward[axis] / dt
