"""Objective of a quadrotor in a grid: J of a motion and its gradient in one call.

The same as `Objective` on the kernels of the terms, whose notation holds here; tests hold both equal. The motion goes
through `motion` and `adjoint` of robots/kernels/quadrotor.py.

`task` is (ends, attitudes, constants, bounds, gamma), see `QuadrotorMap`; `body` (points, fractions of a step at
which densities are taken); `space` (values, leaps, lower, per_meter, scale, lower and upper corner of the box, what
`interpolate_chance` asks for, its `by_distance`, the body's half edges for `outside`, and what `nearness` asks for of
movers); `weights` those of collision, limits, leaving the box, risk, movers and delay.
"""

import math

import numpy as np

from nerfnav.core.jit import kernel
from nerfnav.field.kernels.cells import NEGLIGIBLE_RAW
from nerfnav.planner.kernels.movers import nearness
from nerfnav.planner.kernels.terms import STANDSTILL, control, delay, outside, risk
from nerfnav.robots.kernels.quadrotor import adjoint, limits, motion


@kernel()
def density_between(values, scale, x, y, z):
    """rho [1/m] at a point of the grid, in nodes, and its gradient [1/m per node]; all 0 where it is negligible."""
    nx, ny, nz, _ = values.shape
    i, j, k = min(int(x), nx - 2), min(int(y), ny - 2), min(int(z), nz - 2)
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
    density = scale * (max(raw, 0.0) + math.log1p(exponential))
    return density, slope * (far - near), slope * along_y, slope * along_z


@kernel()
def _place(position, rotation, points, space, nodes):
    """Place body points (3, B) at a position and an attitude, in nodes of the grid (3, B)."""
    lower, per_meter = space[2], space[3]
    for axis in range(3):
        times = float(per_meter[axis])
        by_x, by_y, by_z = times * rotation[axis, 0], times * rotation[axis, 1], times * rotation[axis, 2]
        at = times * (position[axis] - lower[axis])
        for b in range(points.shape[1]):
            nodes[axis, b] = at + by_x * points[0, b] + by_y * points[1, b] + by_z * points[2, b]


@kernel()
def _amid_something(leaps, before, moved, fraction, cells, found):
    """Fill `found` (B) with the points that are in cells with something in them at a fraction of their step; returns
    how many there are.

    First the cell of each point, -1 outside of the grid, in floating point and without branches, so that several are
    done at once; then those of them that count, again without branches, which no processor could predict.
    """
    nx, ny, nz = float(leaps.shape[0]), float(leaps.shape[1]), float(leaps.shape[2])
    for b in range(cells.shape[0]):
        x = before[0, b] + fraction * moved[0, b]
        y = before[1, b] + fraction * moved[1, b]
        z = before[2, b] + fraction * moved[2, b]
        inside = (x >= 0.0) & (x <= nx) & (y >= 0.0) & (y <= ny) & (z >= 0.0) & (z <= nz)
        i, j, k = min(np.floor(x), nx - 1.0), min(np.floor(y), ny - 1.0), min(np.floor(z), nz - 1.0)
        cells[b] = (i * ny + j) * nz + k if inside else -1.0
    count, flat = 0, leaps.reshape(-1)
    for b in range(cells.shape[0]):
        found[count] = b
        empty = flat[np.uint64(max(cells[b], 0.0))] > 0
        count += 1 if (cells[b] >= 0.0) & (not empty) else 0
    return count


@kernel()
def collide(position, rotation, body, space, weight, by_position, by_rotation):
    """`weight` times the collision term; adds its derivatives: `place_points` and `collision` with nothing in
    between."""
    points, fractions = body
    values, leaps, _, per_meter, scale = space[:5]
    count, parts, total = points.shape[0], fractions.shape[0], 0.0
    columns, before, after = np.empty((3, count)), np.empty((3, count)), np.empty((3, count))
    moved = np.empty((3, count))
    cells, found, sums = np.empty(count), np.empty(count + 1, np.int64), np.zeros((count, 7))
    for b in range(count):
        for axis in range(3):
            columns[axis, b] = points[b, axis]
    _place(position[0], rotation[0], columns, space, after)
    for t in range(1, rotation.shape[0]):
        before, after = after, before
        _place(position[t], rotation[t], columns, space, after)
        for axis in range(3):
            for b in range(count):
                moved[axis, b] = after[axis, b] - before[axis, b]
        meets = False
        for k in range(parts):
            f = fractions[k]
            for hit in range(_amid_something(leaps, before, moved, f, cells, found)):
                b = found[hit]
                x, y, z = before[0, b] + f * moved[0, b], before[1, b] + f * moved[1, b], before[2, b] + f * moved[2, b]
                density, gx, gy, gz = density_between(values, scale, x, y, z)
                if density > 0.0:
                    meets = True
                    _add(sums[b], f, density / parts, gx / parts, gy / parts, gz / parts)
        for b in range(count if meets else 0):
            met = sums[b, 0]
            if met == 0.0:
                continue
            dx, dy, dz = moved[0, b] / per_meter[0], moved[1, b] / per_meter[1], moved[2, b] / per_meter[2]
            travelled = math.sqrt(STANDSTILL + dx * dx + dy * dy + dz * dz)
            total += weight * met * travelled
            along, times = weight * met / travelled, weight * travelled
            tx, ty, tz = times * per_meter[0], times * per_meter[1], times * per_meter[2]
            last = (along * dx + tx * sums[b, 4], along * dy + ty * sums[b, 5], along * dz + tz * sums[b, 6])
            first = (tx * sums[b, 1] - last[0], ty * sums[b, 2] - last[1], tz * sums[b, 3] - last[2])
            _pull(t, last, rotation[t], points[b], by_position, by_rotation)
            _pull(t - 1, first, rotation[t - 1], points[b], by_position, by_rotation)
            sums[b] = 0.0
    return total


@kernel()
def _add(row, fraction, density, by_x, by_y, by_z):
    """Add a density, its gradient, and this weighted by the fraction of the step."""
    row[0] += density
    row[1], row[2], row[3] = row[1] + by_x, row[2] + by_y, row[3] + by_z
    row[4], row[5], row[6] = row[4] + fraction * by_x, row[5] + fraction * by_y, row[6] + fraction * by_z


@kernel()
def _pull(t, by_point, rotation, point, by_position, by_rotation):
    """Add what a point's derivative means for the position and the attitude at time t."""
    x, y, z = by_point
    u = rotation[0, 0] * x + rotation[1, 0] * y + rotation[2, 0] * z
    v = rotation[0, 1] * x + rotation[1, 1] * y + rotation[2, 1] * z
    w = rotation[0, 2] * x + rotation[1, 2] * y + rotation[2, 2] * z
    by_position[t, 0] += x
    by_position[t, 1] += y
    by_position[t, 2] += z
    by_rotation[t, 0] += point[1] * w - point[2] * v
    by_rotation[t, 1] += point[2] * u - point[0] * w
    by_rotation[t, 2] += point[0] * v - point[1] * u


@kernel()
def room_for(count):
    """Memory for evaluations at `count` free numbers: positions, velocities, attitudes, body rates and actions, then
    the derivatives by position, attitude and action."""
    steps = (count + 12) // 4
    arrays = np.empty((steps + 2, 3)), np.empty((steps + 1, 3)), np.empty((steps + 1, 3, 3)), np.empty((steps + 1, 3))
    slopes = np.empty((steps + 2, 3)), np.empty((steps + 1, 3)), np.empty((steps, 4))
    return (arrays[0], arrays[1], arrays[2], arrays[3], np.empty((steps, 4))), slopes


@kernel()
def effort_at(free, task, body, space, weights, room):
    """Control, the penalties and the delay of J at `free` (k); fills the room with the motion and their derivatives."""
    ends, attitudes, constants = task[:3]
    (position, velocity, rotation, rate, action), (by_position, by_rotation, by_action) = room
    motion(free, ends, attitudes, constants, position, velocity, rotation, rate, action)
    by_position[:], by_rotation[:], by_action[:] = 0.0, 0.0, 0.0
    return _effort(room[0], room[1], task, space, weights)


@kernel()
def surroundings_at(body, space, weights, room):
    """Collision, risk and nearness of movers of J of the motion in the room; adds their derivatives.

    With weights of 0 nothing of it is evaluated.
    """
    (position, _, rotation, _, action), (by_position, by_rotation, _) = room
    met, risked, near = 0.0, 0.0, 0.0
    path = position[: action.shape[0] + 1]
    if weights[4] != 0.0:
        fractions, boxes, deviation, depth = space[10]
        near = nearness(path, fractions, boxes, deviation, depth, weights[4], by_position)
    if weights[3] != 0.0:
        risked = risk(path, rotation, body[1], space[7], space[8], weights[3], by_position, by_rotation)
    if weights[0] != 0.0:
        met = collide(position, rotation, body, space, weights[0], by_position, by_rotation)
    return met, risked, near


@kernel()
def gradient_at(free, task, room, gradient):
    """Fill the gradient (k) from the derivatives in the room, which are used up."""
    (_, velocity, rotation, rate, action), (by_position, by_rotation, by_action) = room
    adjoint(
        free, task[1], task[2], velocity, rotation, rate, action, by_position, by_rotation, by_action, gradient
    )


@kernel()
def evaluate(free, task, body, space, weights, gradient):
    """Collision, control, the penalties, risk, movers and delay of J at `free` (k); fills the gradient (k)."""
    room = room_for(free.shape[0])
    effort, over, late = effort_at(free, task, body, space, weights, room)
    met, risked, near = surroundings_at(body, space, weights, room)
    gradient_at(free, task, room, gradient)
    return met, effort, over, risked, near, late


@kernel()
def evaluate_motion(motion, task, body, space, weights):
    """The same terms for a motion that is there: positions, velocities, attitudes, body rates and actions."""
    times, steps = motion[0].shape[0], motion[4].shape[0]
    room = motion, (np.zeros((times + 1, 3)), np.zeros((times, 3)), np.zeros((steps, 4)))
    effort, over, late = _effort(room[0], room[1], task, space, weights)
    met, risked, near = surroundings_at(body, space, weights, room)
    return met, effort, over, risked, near, late


@kernel()
def _effort(motion, slopes, task, space, weights):
    """Control, penalties and delay of a motion; adds their derivatives by position, attitude and action."""
    position, velocity, rotation, rate, action = motion
    by_position, by_rotation, by_action = slopes
    constants, bounds, gamma = task[2:]
    effort = control(action, gamma, by_action)
    over = limits(
        velocity, rotation, rate, action, bounds, weights[1], constants[5], by_position, by_rotation, by_action
    )
    over += outside(position, rotation, (space[5], space[6], space[9]), weights[2], by_position, by_rotation)
    late = 0.0
    if weights[5] != 0.0:
        late = delay(position[: action.shape[0] + 1], weights[5], by_position)
    return effort, over, late


_REACH = 4
"""Time steps over which free numbers count in the same action: a position counts in attitudes up to two steps before
it, and each of those in actions up to two steps before."""


@kernel()
def effort_curvature(free, task, body, space, weights, steps):
    """Differences (k, k) of the gradient over `steps` (k) of each free number, of effort, penalties and delay alone.

    Free numbers too far apart to count in the same action are moved together (Curtis, Powell and Reid 1974): the number
    of evaluations does not grow with the number of time steps.
    """
    count, apart = free.shape[0], 2 * _REACH + 1
    here, ahead, moved, room = np.empty(count), np.empty(count), free.copy(), room_for(count)
    times, kinds = np.empty(count, np.int64), np.empty(count, np.int64)
    headings = count - (count + 4) // 4
    for i in range(count):  # thrusts of the first two steps, positions, headings: see `motion`
        times[i] = 3 if i < 2 else 4 + (i - 2) // 3 if i < headings else 2 + i - headings
        kinds[i] = i if i < 2 else 2 + (i - 2) % 3 if i < headings else 5
    curvature = np.zeros((count, count))
    together = np.zeros(count, np.bool_)
    for group in range(-1, 6 * apart):  # none is moved in the first
        several = group < 0
        for i in range(count):
            together[i] = kinds[i] == group // apart and times[i] % apart == group % apart
            moved[i] = free[i] + steps[i] if together[i] else free[i]
            several |= together[i]
        if not several:
            continue
        effort_at(moved, task, body, space, weights, room)
        gradient_at(moved, task, room, here if group < 0 else ahead)
        for i in range(count):
            for j in range(count if together[i] else 0):
                if abs(times[j] - times[i]) <= _REACH:
                    curvature[i, j] = (ahead[j] - here[j]) / steps[i]
    return curvature
