"""Quadrotor's flatness map, its limits and its adjoint: twin of `Quadrotor.motion`, `Quadrotor.limits` and autograd.

Notation as in robots/quadrotor.py. The adjoint of an attitude R is a vector g in its body tangent: a change R -> R
Exp(delta) changes the cost by g . delta. Each term of the limits is a squared excess over a bound, as a share of the
bound.
"""

import math

import numpy as np

from nerfnav.core.jit import kernel
from nerfnav.geometry.linear import copy_matrix
from nerfnav.geometry.rotations import cross, inverse_left_jacobian, log_between, turned


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


@kernel()
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


@kernel()
def _length(vector):
    return math.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)


@kernel()
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


@kernel()
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


NO_THRUST = 1e-4
"""Acceleration by thrust [m/s^2] below which it has no direction to speak of."""


@kernel()
def turn(rotation, angle, out):
    """out = R Exp(angle)."""
    turned(rotation, angle[0], angle[1], angle[2], out)


@kernel()
def motion(free, ends, attitudes, constants, position, velocity, rotation, rate, action):
    """Fill position (N+2, 3), velocity (N+1, 3), rotation (N+1, 3, 3), rate (N+1, 3) and action (N, 4).

    `ends` (6, 3) are p, v, w of the start and of the goal; `attitudes` (3, 3, 3) are R_0, R_1, R_N; `constants` are
    mass, J_x, J_y, J_z, gravity, dt. The last position is virtual: one step beyond the goal.
    """
    steps = action.shape[0]
    mass, gravity, dt = constants[0], constants[4], constants[5]
    _positions(free, ends, attitudes, constants, position)
    for axis in range(3):
        velocity[0, axis], velocity[steps, axis] = ends[1, axis], ends[4, axis]
        rate[0, axis], rate[steps, axis] = ends[2, axis], ends[5, axis]
        for t in range(1, steps):
            velocity[t, axis] = (position[t + 1, axis] - position[t, axis]) / dt
    for end in range(3):
        copy_matrix(attitudes[end], rotation[end if end < 2 else steps])
    action[0, 0], action[1, 0] = free[0], free[1]
    pull = np.empty(3)
    for t in range(2, steps):
        for axis in range(3):
            pull[axis] = (velocity[t + 1, axis] - velocity[t, axis]) / dt
        pull[2] += gravity
        action[t, 0] = mass * _upright(pull)
        _attitude(pull, free[2 + 3 * (steps - 4) + t - 2], rotation[t])
    for t in range(1, steps):
        log_between(rotation[t], rotation[t + 1], rate[t])
        for axis in range(3):
            rate[t, axis] /= dt
    momentum, gyroscopic = np.empty(3), np.empty(3)
    for t in range(steps):
        for axis in range(3):
            momentum[axis] = constants[1 + axis] * rate[t, axis]
        cross(rate[t], momentum, gyroscopic)
        for axis in range(3):
            change = (rate[t + 1, axis] - rate[t, axis]) / dt
            action[t, 1 + axis] = constants[1 + axis] * change + gyroscopic[axis]


@kernel()
def adjoint(
    free, attitudes, constants, velocity, rotation, rate, action, by_position, by_rotation, by_action, gradient
):
    """Turn the derivatives of a cost by position, attitude and action into `gradient`, its derivative by `free`.

    by_position (N+2, 3) and by_rotation (N+1, 3) are used up as scratch.
    """
    steps = action.shape[0]
    mass, gravity, dt = constants[0], constants[4], constants[5]
    _through_rates(constants, rotation, rate, by_action, by_rotation)
    pull, by_pull = np.empty(3), np.empty(3)
    yaws = 2 + 3 * (steps - 4)
    for t in range(2, steps):
        for axis in range(3):
            pull[axis] = (velocity[t + 1, axis] - velocity[t, axis]) / dt
        pull[2] += gravity
        thrust = _upright(pull)
        gradient[yaws + t - 2] = by_rotation[t, 2]
        guarded = action[t, 0] <= mass * NO_THRUST * (1.0 + 1e-9)
        _through_attitude(pull, free[yaws + t - 2], rotation[t], by_rotation[t], by_pull)
        along = by_pull[0] * pull[0] + by_pull[1] * pull[1] + by_pull[2] * pull[2]
        for axis in range(3):
            slope = (by_pull[axis] - along * pull[axis]) / thrust + mass * by_action[t, 0] * pull[axis]
            # a = (v_{t+1} - v_t) / dt with v_t = (p_{t+1} - p_t) / dt, but v_N is the goal's
            step = 0.0 if guarded else slope / (dt * dt)
            by_position[t, axis] += step
            by_position[t + 1, axis] -= 2.0 * step
            by_position[t + 2, axis] += step
    push_first, push_second = 0.0, 0.0
    for axis in range(3):
        second, third = by_position[2, axis], by_position[3, axis]
        push_first += (second + 2.0 * third) * attitudes[0, axis, 2]
        push_second += third * attitudes[1, axis, 2]
        for t in range(4, steps):
            gradient[2 + 3 * (t - 4) + axis] = by_position[t, axis]
    gradient[0] = by_action[0, 0] + push_first * dt * dt / mass
    gradient[1] = by_action[1, 0] + push_second * dt * dt / mass


@kernel()
def _positions(free, ends, attitudes, constants, position):
    """p_0 .. p_{N+1}."""
    steps = position.shape[0] - 2
    mass, gravity, dt = constants[0], constants[4], constants[5]
    for axis in range(3):
        fall = -gravity if axis == 2 else 0.0
        first_push = attitudes[0, axis, 2] * free[0] / mass + fall
        second_push = attitudes[1, axis, 2] * free[1] / mass + fall
        position[0, axis] = ends[0, axis]
        position[1, axis] = ends[0, axis] + ends[1, axis] * dt
        position[2, axis] = position[1, axis] + (ends[1, axis] + first_push * dt) * dt
        position[3, axis] = 2.0 * position[2, axis] - position[1, axis] + second_push * dt * dt
        for t in range(4, steps):
            position[t, axis] = free[2 + 3 * (t - 4) + axis]
        position[steps, axis] = ends[3, axis]
        position[steps + 1, axis] = ends[3, axis] + ends[4, axis] * dt


@kernel()
def _upright(pull):
    """|a|, with a made a unit vector in place; upright where there is hardly any."""
    size = math.sqrt(pull[0] ** 2 + pull[1] ** 2 + pull[2] ** 2)
    if not size > NO_THRUST:
        pull[0], pull[1], pull[2] = 0.0, 0.0, 1.0
        return NO_THRUST
    for axis in range(3):
        pull[axis] /= size
    return size


@kernel()
def _attitude(n, yaw, rotation):
    """R = Tilt(n) Rz(yaw)."""
    x, y, z = n[0], n[1], n[2]
    share = 1.0 / max(1.0 + z, 1e-6)
    xx, xy, yy = 1.0 - x * x * share, -x * y * share, 1.0 - y * y * share
    cosine, sine = math.cos(yaw), math.sin(yaw)
    rotation[0, 0], rotation[0, 1], rotation[0, 2] = cosine * xx + sine * xy, cosine * xy - sine * xx, x
    rotation[1, 0], rotation[1, 1], rotation[1, 2] = cosine * xy + sine * yy, cosine * yy - sine * xy, y
    rotation[2, 0], rotation[2, 1], rotation[2, 2] = -cosine * x - sine * y, sine * x - cosine * y, z


@kernel()
def _through_attitude(n, yaw, rotation, by_tangent, by_n):
    """Derivative by n of a cost whose derivative in the body tangent of R = Tilt(n) Rz(yaw) is `by_tangent`."""
    cosine, sine = math.cos(yaw), math.sin(yaw)
    # by_r = R [g]x / 2 has <by_r, R [delta]x> = g . delta; then by_tilt = by_r Rz(yaw)', row by row
    x, y = n[0], n[1]
    share = 1.0 / max(1.0 + n[2], 1e-6)
    by_xx, by_yx, by_nx = _tilted(rotation, 0, by_tangent, cosine, sine)
    by_xy, by_yy, by_ny = _tilted(rotation, 1, by_tangent, cosine, sine)
    by_zx, by_zy, by_nz = _tilted(rotation, 2, by_tangent, cosine, sine)
    by_xy += by_yx
    by_share = -x * x * by_xx - x * y * by_xy - y * y * by_yy
    by_n[0] = by_nx - by_zx - share * (2.0 * x * by_xx + y * by_xy)
    by_n[1] = by_ny - by_zy - share * (2.0 * y * by_yy + x * by_xy)
    by_n[2] = by_nz - share * share * by_share


@kernel()
def _tilted(rotation, row, by_tangent, cosine, sine):
    """A row of the derivative by Tilt(n)."""
    g0, g1, g2 = 0.5 * by_tangent[0], 0.5 * by_tangent[1], 0.5 * by_tangent[2]
    a, b, c = rotation[row, 0], rotation[row, 1], rotation[row, 2]
    left, middle = b * g2 - c * g1, c * g0 - a * g2
    return left * cosine - middle * sine, left * sine + middle * cosine, a * g1 - b * g0


@kernel()
def _through_rates(constants, rotation, rate, by_action, by_rotation):
    """Add what the torques cost to the derivatives by attitude, through the body rates."""
    steps = by_action.shape[0]
    dt = constants[5]
    by_rate = np.zeros((steps + 1, 3))
    momentum, spun, other = np.empty(3), np.empty(3), np.empty(3)
    for t in range(steps):
        for axis in range(3):
            momentum[axis] = constants[1 + axis] * rate[t, axis]
        by_torque = by_action[t, 1:]
        cross(momentum, by_torque, spun)
        cross(by_torque, rate[t], other)
        for axis in range(3):
            change = constants[1 + axis] * by_torque[axis] / dt
            by_rate[t + 1, axis] += change
            by_rate[t, axis] += spun[axis] + constants[1 + axis] * other[axis] - change
    theta, forward, backward = np.empty(3), np.empty(3), np.empty(3)
    for t in range(1, steps):
        for axis in range(3):
            theta[axis] = rate[t, axis] * dt
        # d theta = Jr^-1 delta_{t+1} - Jl^-1 delta_t, and the transpose of Jr^-1 is Jl^-1
        inverse_left_jacobian(theta, 1.0, by_rate[t], forward)
        inverse_left_jacobian(theta, -1.0, by_rate[t], backward)
        for axis in range(3):
            by_rotation[t + 1, axis] += forward[axis] / dt
            by_rotation[t, axis] -= backward[axis] / dt
