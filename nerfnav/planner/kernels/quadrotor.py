"""J of a quadrotor's motion in a grid, its gradient, and steps of the search for its minimum, each in one call.

The same as objective.py on the kernels of the terms and quasi_newton.py, whose notation holds here; tests hold both
equal. The motion goes through `motion` and `adjoint` of robots/kernels/quadrotor.py.

`task` is (ends, attitudes, constants, bounds, gamma), see `QuadrotorMap`; `body` (points, fractions of a step at which
densities are taken); `space` (values, leaps, lower, per_meter, scale, lower and upper corner of the box, what
`chance_at` asks for, and its `by_way`); `weights` those of collision, limits, leaving the box and risk.
"""

import math

import numpy as np

from nerfnav.compiled import kernel
from nerfnav.field.kernels.cells import NEGLIGIBLE_RAW
from nerfnav.planner.kernels.collision import STANDSTILL, control, outside
from nerfnav.planner.kernels.danger import endangered
from nerfnav.planner.kernels.quasi_newton import rank_two
from nerfnav.robots.kernels.quadrotor import adjoint, motion
from nerfnav.robots.kernels.quadrotor_limits import limits


@kernel(inline=True)
def density_at(space, x, y, z):
    """rho [1/m] at a point of the world and its gradient [1/m^2]; all 0 in empty cells and outside the grid."""
    values, leaps, lower, per_meter, scale = space[:5]
    nx, ny, nz, _ = values.shape
    x, y, z = (x - lower[0]) * per_meter[0], (y - lower[1]) * per_meter[1], (z - lower[2]) * per_meter[2]
    if not (0.0 <= x <= nx - 1 and 0.0 <= y <= ny - 1 and 0.0 <= z <= nz - 1):
        return 0.0, 0.0, 0.0, 0.0
    i, j, k = min(int(x), nx - 2), min(int(y), ny - 2), min(int(z), nz - 2)
    if leaps[i, j, k] > 0:
        return 0.0, 0.0, 0.0, 0.0
    x, y, z = x - i, y - j, z - k
    edge00, slope00 = values[i, j, k, 0], values[i, j, k + 1, 0] - values[i, j, k, 0]
    edge01, slope01 = values[i, j + 1, k, 0], values[i, j + 1, k + 1, 0] - values[i, j + 1, k, 0]
    edge10, slope10 = values[i + 1, j, k, 0], values[i + 1, j, k + 1, 0] - values[i + 1, j, k, 0]
    edge11, slope11 = values[i + 1, j + 1, k, 0], values[i + 1, j + 1, k + 1, 0] - values[i + 1, j + 1, k, 0]
    edge00, edge01 = edge00 + z * slope00, edge01 + z * slope01
    edge10, edge11 = edge10 + z * slope10, edge11 + z * slope11
    near, far = edge00 + y * (edge01 - edge00), edge10 + y * (edge11 - edge10)
    raw = near + x * (far - near)
    if raw < NEGLIGIBLE_RAW:
        return 0.0, 0.0, 0.0, 0.0
    exponential = math.exp(-abs(raw))
    slope = scale * (1.0 if raw > 0.0 else exponential) / (1.0 + exponential)
    along_y = (1.0 - x) * (edge01 - edge00) + x * (edge11 - edge10)
    along_z = (1.0 - x) * ((1.0 - y) * slope00 + y * slope01) + x * ((1.0 - y) * slope10 + y * slope11)
    return (
        scale * (max(raw, 0.0) + math.log1p(exponential)), slope * per_meter[0] * (far - near),
        slope * per_meter[1] * along_y, slope * per_meter[2] * along_z,
    )  # fmt: skip


@kernel()
def collide(position, rotation, body, space, weight, by_position, by_rotation):
    """`weight` times the collision term; adds its derivatives: `spread` and `collision` with nothing in between."""
    points, fractions = body
    count, parts = points.shape[0], fractions.shape[0]
    total, before, after = 0.0, np.empty((count, 3)), np.empty((count, 3))
    for t in range(rotation.shape[0]):
        for b in range(count):
            for axis in range(3):
                before[b, axis] = after[b, axis]
                after[b, axis] = (
                    position[t, axis]
                    + rotation[t, axis, 0] * points[b, 0]
                    + rotation[t, axis, 1] * points[b, 1]
                    + rotation[t, axis, 2] * points[b, 2]
                )
        for b in range(count if t > 0 else 0):
            x, y, z = before[b, 0], before[b, 1], before[b, 2]
            dx, dy, dz = after[b, 0] - x, after[b, 1] - y, after[b, 2] - z
            met = sx = sy = sz = tx = ty = tz = 0.0
            for k in range(parts):
                f = fractions[k]
                density, gx, gy, gz = density_at(space, x + f * dx, y + f * dy, z + f * dz)
                if density > 0.0:
                    met += density / parts
                    sx, sy, sz = sx + gx / parts, sy + gy / parts, sz + gz / parts
                    tx, ty, tz = tx + f * gx / parts, ty + f * gy / parts, tz + f * gz / parts
            if met == 0.0:
                continue
            travelled = math.sqrt(STANDSTILL + dx * dx + dy * dy + dz * dz)
            total += weight * met * travelled
            along = met / travelled
            last = (weight * (along * dx + travelled * tx), weight * (along * dy + travelled * ty),
                    weight * (along * dz + travelled * tz))  # fmt: skip
            first = (weight * travelled * sx - last[0], weight * travelled * sy - last[1],
                     weight * travelled * sz - last[2])  # fmt: skip
            _pull(t, last, rotation[t], points[b], by_position, by_rotation)
            _pull(t - 1, first, rotation[t - 1], points[b], by_position, by_rotation)
    return total


@kernel(inline=True)
def _pull(t, by_point, rotation, point, by_position, by_rotation):
    """Add what a point's derivative means for the position and the attitude at time t."""
    u = rotation[0, 0] * by_point[0] + rotation[1, 0] * by_point[1] + rotation[2, 0] * by_point[2]
    v = rotation[0, 1] * by_point[0] + rotation[1, 1] * by_point[1] + rotation[2, 1] * by_point[2]
    w = rotation[0, 2] * by_point[0] + rotation[1, 2] * by_point[1] + rotation[2, 2] * by_point[2]
    for axis in range(3):
        by_position[t, axis] += by_point[axis]
    by_rotation[t, 0] += point[1] * w - point[2] * v
    by_rotation[t, 1] += point[2] * u - point[0] * w
    by_rotation[t, 2] += point[0] * v - point[1] * u


@kernel()
def evaluate(free, task, body, space, weights, gradient):
    """Collision, control, the penalties and risk of J at `free` (k); fills the gradient (k).

    With weights of 0 for collision and risk nothing is asked of the field: the terms for preconditioning alone.
    """
    ends, attitudes, constants, bounds, gamma = task
    steps = (free.shape[0] + 12) // 4
    position, velocity, rate = np.empty((steps + 2, 3)), np.empty((steps + 1, 3)), np.empty((steps + 1, 3))
    rotation, action = np.empty((steps + 1, 3, 3)), np.empty((steps, 4))
    motion(free, ends, attitudes, constants, position, velocity, rotation, rate, action)
    by_position, by_rotation, by_action = np.zeros((steps + 2, 3)), np.zeros((steps + 1, 3)), np.zeros((steps, 4))
    met, risked = 0.0, 0.0
    if weights[3] != 0.0:
        risked = endangered(position[: steps + 1], body[1], space[7], space[8], weights[3], by_position)
    if weights[0] != 0.0:
        met = collide(position, rotation, body, space, weights[0], by_position, by_rotation)
    effort = control(action, gamma, by_action)
    over = limits(
        velocity, rotation, rate, action, bounds, weights[1], constants[5], by_position, by_rotation, by_action
    )
    over += outside(position[: steps + 1], space[5], space[6], weights[2], by_position)
    adjoint(
        free, attitudes, constants, velocity, rotation, rate, action, by_position, by_rotation, by_action, gradient
    )
    return met, effort, over, risked


@kernel()
def effort_curvature(free, task, body, space, weights, steps):
    """Differences (k, k) of the gradient over `steps` (k) of each free number, without the collision term."""
    count = free.shape[0]
    still = (0.0, weights[1], weights[2], 0.0)
    here, ahead, moved = np.empty(count), np.empty(count), free.copy()
    curvature = np.empty((count, count))
    evaluate(free, task, body, space, still, here)
    for i in range(count):
        moved[i] = free[i] + steps[i]
        evaluate(moved, task, body, space, still, ahead)
        moved[i] = free[i]
        for j in range(count):
            curvature[i, j] = (ahead[j] - here[j]) / steps[i]
    return curvature


@kernel()
def search_along(free, direction, lengths, task, body, space, weights, rule, tried, gradient):
    """Backtracking on Armijo's rule; fills the point and the gradient that it ends at.

    `lengths` is (J, slope, first length), `rule` (share of the slope, least and largest factor between two tries,
    tries). Returns whether one was found, and the terms of J there.
    """
    total, slope, length = lengths
    armijo, low, high, most = rule
    for _ in range(most):
        for i in range(free.shape[0]):
            tried[i] = free[i] + length * direction[i]
        met, effort, over, risked = evaluate(tried, task, body, space, weights, gradient)
        gain = met + effort + over + risked - total
        if gain <= armijo * length * slope:
            return True, met, effort, over, risked
        best = -0.5 * slope * length**2 / (gain - slope * length)
        length *= min(max(best / length, low), high) if math.isfinite(best) else high
    return False, 0.0, 0.0, 0.0, 0.0


@kernel()
def newton_step(free, gradient, inverse, total, reach, task, body, space, weights, rule, damping):
    """One step of BFGS: (found, point, its gradient, the next inverse Hessian, the terms of J)."""
    count = free.shape[0]
    direction, slope, longest = np.empty(count), 0.0, 0.0
    for i in range(count):
        along = 0.0
        for j in range(count):
            along -= inverse[i, j] * gradient[j]
        direction[i] = along
        slope += along * gradient[i]
        longest = max(longest, abs(along) / reach[i])
    tried, there, found = np.empty(count), np.empty(count), False
    met = effort = over = risked = 0.0
    if slope < 0.0:
        lengths = (total, slope, min(1.0, 1.0 / longest))
        found, met, effort, over, risked = search_along(
            free, direction, lengths, task, body, space, weights, rule, tried, there
        )
    if not found:
        return False, tried, there, inverse, met, effort, over, risked
    step, change, squared, length = np.empty(count), np.empty(count), 0.0, 0.0
    for i in range(count):
        step[i], change[i] = tried[i] - free[i], there[i] - gradient[i]
        squared += direction[i] * direction[i]
        length += step[i] * direction[i]
    length /= squared
    expected, seen = 0.0, 0.0
    for i in range(count):
        expected -= step[i] * length * gradient[i]
        seen += step[i] * change[i]
    if seen < damping * expected:
        share = (1.0 - damping) * expected / (expected - seen)
        seen = 0.0
        for i in range(count):
            change[i] = share * change[i] - (1.0 - share) * length * gradient[i]
            seen += step[i] * change[i]
    along, twice = np.empty(count), 0.0
    for i in range(count):
        along[i] = 0.0
        for j in range(count):
            along[i] += inverse[i, j] * change[j]
        twice += change[i] * along[i]
    updated = rank_two(inverse, step, along, (1.0 + twice / seen) / seen, 1.0 / seen)
    return True, tried, there, updated, met, effort, over, risked
