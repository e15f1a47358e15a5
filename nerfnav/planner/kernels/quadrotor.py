"""J of a quadrotor's motion in a grid and its gradient in one call.

The same as objective.py on the kernels of the terms, whose notation holds here; tests hold both equal. The motion goes
through `motion` and `adjoint` of robots/kernels/quadrotor.py.

`task` is (ends, attitudes, constants, bounds, gamma), see `QuadrotorMap`; `body` (points, fractions of a step at which
densities are taken); `space` (values, leaps, lower, per_meter, scale, lower and upper corner of the box, what
`chance_at` asks for, its `by_way`, and the body's half edges for `outside`); `weights` those of collision, limits,
leaving the box and risk.
"""

import math

import numpy as np

from nerfnav.compiled import kernel
from nerfnav.field.kernels.cells import NEGLIGIBLE_RAW
from nerfnav.planner.kernels.border import outside
from nerfnav.planner.kernels.collision import STANDSTILL, control
from nerfnav.planner.kernels.danger import endangered
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


@kernel(inline=True)
def _place(position, rotation, points, world):
    """Fill where body points (3, B) are at a position and an attitude, (3, B)."""
    for axis in range(3):
        by_x, by_y, by_z, at = rotation[axis, 0], rotation[axis, 1], rotation[axis, 2], position[axis]
        for b in range(points.shape[1]):
            world[axis, b] = at + by_x * points[0, b] + by_y * points[1, b] + by_z * points[2, b]


@kernel(inline=True)
def _cells_between(space, before, after, fraction, cells):
    """Fill the cells (B) in which points are at a fraction of their step, as places in the flat grid; -1 outside of it.

    In floating point and without branches, so that several are done at once.
    """
    leaps, lower, per_meter = space[1:4]
    nx, ny, nz = float(leaps.shape[0]), float(leaps.shape[1]), float(leaps.shape[2])
    for b in range(cells.shape[0]):
        x = (before[0, b] + fraction * (after[0, b] - before[0, b]) - lower[0]) * per_meter[0]
        y = (before[1, b] + fraction * (after[1, b] - before[1, b]) - lower[1]) * per_meter[1]
        z = (before[2, b] + fraction * (after[2, b] - before[2, b]) - lower[2]) * per_meter[2]
        inside = (x >= 0.0) & (x <= nx) & (y >= 0.0) & (y <= ny) & (z >= 0.0) & (z <= nz)
        i, j, k = min(np.floor(x), nx - 1.0), min(np.floor(y), ny - 1.0), min(np.floor(z), nz - 1.0)
        cells[b] = (i * ny + j) * nz + k if inside else -1.0


@kernel()
def collide(position, rotation, body, space, weight, by_position, by_rotation):
    """`weight` times the collision term; adds its derivatives: `spread` and `collision` with nothing in between."""
    points, fractions = body
    count, parts, total = points.shape[0], fractions.shape[0], 0.0
    columns, before, after = np.empty((3, count)), np.empty((3, count)), np.empty((3, count))
    cells, sums, leaps = np.empty(count), np.empty((count, 7)), space[1].reshape(-1)
    for b in range(count):
        for axis in range(3):
            columns[axis, b] = points[b, axis]
    _place(position[0], rotation[0], columns, after)
    for t in range(1, rotation.shape[0]):
        before, after = after, before
        _place(position[t], rotation[t], columns, after)
        sums[:] = 0.0
        meets = False
        for k in range(parts):
            f = fractions[k]
            _cells_between(space, before, after, f, cells)
            for b in range(count):
                if cells[b] < 0.0 or leaps[int(cells[b])] > 0:
                    continue
                x, y, z = before[0, b], before[1, b], before[2, b]
                density, gx, gy, gz = density_at(
                    space, x + f * (after[0, b] - x), y + f * (after[1, b] - y), z + f * (after[2, b] - z)
                )
                if density > 0.0:
                    meets = True
                    _add(sums[b], f, density / parts, gx / parts, gy / parts, gz / parts)
        for b in range(count if meets else 0):
            met = sums[b, 0]
            if met == 0.0:
                continue
            x, y, z = before[0, b], before[1, b], before[2, b]
            dx, dy, dz = after[0, b] - x, after[1, b] - y, after[2, b] - z
            travelled = math.sqrt(STANDSTILL + dx * dx + dy * dy + dz * dz)
            total += weight * met * travelled
            along, last, first = met / travelled, np.empty(3), np.empty(3)
            last[0] = weight * (along * dx + travelled * sums[b, 4])
            last[1] = weight * (along * dy + travelled * sums[b, 5])
            last[2] = weight * (along * dz + travelled * sums[b, 6])
            for axis in range(3):
                first[axis] = weight * travelled * sums[b, 1 + axis] - last[axis]
            _pull(t, last, rotation[t], points[b], by_position, by_rotation)
            _pull(t - 1, first, rotation[t - 1], points[b], by_position, by_rotation)
    return total


@kernel(inline=True)
def _add(row, fraction, density, by_x, by_y, by_z):
    """Add a density, its gradient, and this weighted by the fraction of the step."""
    row[0] += density
    row[1], row[2], row[3] = row[1] + by_x, row[2] + by_y, row[3] + by_z
    row[4], row[5], row[6] = row[4] + fraction * by_x, row[5] + fraction * by_y, row[6] + fraction * by_z


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
    ends, attitudes, constants = task[:3]
    steps = (free.shape[0] + 12) // 4
    position, velocity, rate = np.empty((steps + 2, 3)), np.empty((steps + 1, 3)), np.empty((steps + 1, 3))
    rotation, action = np.empty((steps + 1, 3, 3)), np.empty((steps, 4))
    motion(free, ends, attitudes, constants, position, velocity, rotation, rate, action)
    slopes = np.zeros((steps + 2, 3)), np.zeros((steps + 1, 3)), np.zeros((steps, 4))
    terms = _terms((position, velocity, rotation, rate, action), slopes, task, body, space, weights)
    by_position, by_rotation, by_action = slopes
    adjoint(
        free, attitudes, constants, velocity, rotation, rate, action, by_position, by_rotation, by_action, gradient
    )
    return terms


@kernel()
def evaluate_motion(motion, task, body, space, weights):
    """The same terms for a motion that is there: positions, velocities, attitudes, body rates and actions."""
    times, steps = motion[0].shape[0], motion[4].shape[0]
    slopes = np.zeros((times + 1, 3)), np.zeros((times, 3)), np.zeros((steps, 4))
    return _terms(motion, slopes, task, body, space, weights)


@kernel(inline=True)
def _terms(motion, slopes, task, body, space, weights):
    """Collision, control, penalties and risk of a motion; adds their derivatives by position, attitude and action."""
    position, velocity, rotation, rate, action = motion
    by_position, by_rotation, by_action = slopes
    _, _, constants, bounds, gamma = task
    steps, met, risked = action.shape[0], 0.0, 0.0
    if weights[3] != 0.0:
        risked = endangered(position[: steps + 1], body[1], space[7], space[8], weights[3], by_position)
    if weights[0] != 0.0:
        met = collide(position, rotation, body, space, weights[0], by_position, by_rotation)
    effort = control(action, gamma, by_action)
    over = limits(
        velocity, rotation, rate, action, bounds, weights[1], constants[5], by_position, by_rotation, by_action
    )
    over += outside(position, rotation, (space[5], space[6], space[9]), weights[2], by_position, by_rotation)
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
