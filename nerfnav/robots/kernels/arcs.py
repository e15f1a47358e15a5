"""Speeds and headings that lead to a place, and what a cost changes with the free ones: twin of robots/arcs.py.

Notation there. With y = (J W J' + mu |r|^2 I)^-1 r, one round is f(z) = z - W J' y; with l the derivative of a cost
by f(z), u = J W l and s = (J W J' + mu |r|^2 I)^-1 u, its derivative by z is

    l - J' s + 2 mu (s . y) J' r + (y' dJ) (W J' s - W l) + (s' dJ) (W J' y)

where (a' dJ) d = d(a' J d)/dz is the Hessian of a . sum q times d.
"""

import math

import numpy as np

from nerfnav.core.jit import kernel
from nerfnav.robots.arcs import ARRIVED, LEAST, MU, ROUNDS, SMALL, TYPICAL_SPEED, TYPICAL_TURN


@kernel()
def chords(turn):
    """S, S' and S''."""
    squared = turn * turn
    if abs(turn) < SMALL:
        return (
            1.0 - squared / 24.0 * (1.0 - squared / 80.0 * (1.0 - squared / 168.0)),
            -turn / 12.0 * (1.0 - squared / 40.0 * (1.0 - squared / 112.0)),
            -(1.0 - 3.0 * squared / 40.0 * (1.0 - 5.0 * squared / 336.0)) / 12.0,
        )
    chord = math.sin(0.5 * turn) / (0.5 * turn)
    slope = (math.cos(0.5 * turn) - chord) / turn
    return chord, slope, -0.25 * chord - 2.0 * slope / turn


@kernel()
def path(numbers, ends, last, dt, speeds, yaw):
    """Fill speeds and headings (N+1) at all times from the free ones; `ends` as in kernels/diffdrive.py."""
    steps = yaw.shape[0] - 1
    speeds[0], speeds[steps] = ends[0, 3], ends[1, 3]
    yaw[0], yaw[1], yaw[steps] = ends[0, 2], ends[0, 2] + ends[0, 4] * dt, last
    for t in range(1, steps):
        speeds[t] = numbers[t - 1]
    for t in range(2, steps):
        yaw[t] = numbers[steps - 3 + t]


@kernel()
def pull(speeds, yaw, dt, t, x, y):
    """Derivatives of (x, y) . q by the speed and the two headings of step t."""
    chord, slope, _ = chords(yaw[t + 1] - yaw[t])
    middle = 0.5 * (yaw[t] + yaw[t + 1])
    cosine, sine = math.cos(middle), math.sin(middle)
    along, across = x * cosine + y * sine, y * cosine - x * sine
    bent, swung = speeds[t] * dt * slope * along, 0.5 * speeds[t] * dt * chord * across
    return dt * chord * along, swung - bent, swung + bent


@kernel()
def close(free, ends, last, dt, iterates):
    """Fill the rows of `iterates` with what the rounds make of the free numbers; returns how many rounds there were."""
    count = free.shape[0]
    steps = (count + 3) // 2
    speeds, yaw, jacobian = np.empty(steps + 1), np.empty(steps + 1), np.empty((count, 2))
    for i in range(count):
        iterates[0, i] = free[i]
    for turn in range(ROUNDS):
        path(iterates[turn], ends, last, dt, speeds, yaw)
        x, y = _linearise(speeds, yaw, ends, dt, jacobian)
        a, b = _solve(jacobian, x, y, x, y)
        for i in range(count):
            moved = _metric(i, steps) * (jacobian[i, 0] * a + jacobian[i, 1] * b)
            iterates[turn + 1, i] = iterates[turn, i] - moved
        if abs(x) < ARRIVED and abs(y) < ARRIVED:
            return turn + 1
    return ROUNDS


@kernel()
def through_closing(iterates, rounds, ends, last, dt, by):
    """Turn `by`, the derivative of a cost by what the rounds ended with, into that by the free numbers, in place."""
    count = by.shape[0]
    steps = (count + 3) // 2
    speeds, yaw, jacobian = np.empty(steps + 1), np.empty(steps + 1), np.empty((count, 2))
    first, second = np.empty(count), np.empty(count)
    for turn in range(rounds - 1, -1, -1):
        path(iterates[turn], ends, last, dt, speeds, yaw)
        x, y = _linearise(speeds, yaw, ends, dt, jacobian)
        a, b = _solve(jacobian, x, y, x, y)
        u, v = 0.0, 0.0
        for i in range(count):
            u += jacobian[i, 0] * _metric(i, steps) * by[i]
            v += jacobian[i, 1] * _metric(i, steps) * by[i]
        s, r = _solve(jacobian, x, y, u, v)
        damped = 2.0 * MU * (s * a + r * b)
        for i in range(count):
            metric, held = _metric(i, steps), jacobian[i, 0] * s + jacobian[i, 1] * r
            first[i] = metric * (held - by[i])
            second[i] = metric * (jacobian[i, 0] * a + jacobian[i, 1] * b)
            by[i] += damped * (jacobian[i, 0] * x + jacobian[i, 1] * y) - held
        _bend(speeds, yaw, dt, a, b, first, by)
        _bend(speeds, yaw, dt, s, r, second, by)


@kernel()
def _metric(index, steps):
    """The diagonal of W."""
    return TYPICAL_SPEED**2 if index < steps - 1 else TYPICAL_TURN**2


@kernel()
def _linearise(speeds, yaw, ends, dt, jacobian):
    """Fill J (k, 2); returns r."""
    steps = yaw.shape[0] - 1
    jacobian[:] = 0.0
    missed_x, missed_y = ends[0, 0] - ends[1, 0], ends[0, 1] - ends[1, 1]
    for t in range(steps):
        for axis in range(2):
            by_speed, by_first, by_second = pull(speeds, yaw, dt, t, 1.0 - axis, 1.0 * axis)
            if axis == 0:
                missed_x += speeds[t] * by_speed
            else:
                missed_y += speeds[t] * by_speed
            if t >= 1:
                jacobian[t - 1, axis] += by_speed
            if t >= 2:
                jacobian[steps - 3 + t, axis] += by_first
            if 1 <= t < steps - 1:
                jacobian[steps - 2 + t, axis] += by_second
    return missed_x, missed_y


@kernel()
def _solve(jacobian, missed_x, missed_y, x, y):
    """(J W J' + mu |r|^2 I)^-1 (x, y)."""
    steps = (jacobian.shape[0] + 3) // 2
    damping = MU * (missed_x * missed_x + missed_y * missed_y) + LEAST
    a, b, c = damping, 0.0, damping
    for i in range(jacobian.shape[0]):
        metric = _metric(i, steps)
        a += metric * jacobian[i, 0] * jacobian[i, 0]
        b += metric * jacobian[i, 0] * jacobian[i, 1]
        c += metric * jacobian[i, 1] * jacobian[i, 1]
    size = a * c - b * b
    return (c * x - b * y) / size, (a * y - b * x) / size


@kernel()
def _bend(speeds, yaw, dt, x, y, change, by):
    """Add to `by` the Hessian of (x, y) . sum q times `change`."""
    steps = yaw.shape[0] - 1
    for t in range(steps):
        chord, slope, curve = chords(yaw[t + 1] - yaw[t])
        middle, way = 0.5 * (yaw[t] + yaw[t + 1]), speeds[t] * dt
        cosine, sine = math.cos(middle), math.sin(middle)
        along, across = x * cosine + y * sine, y * cosine - x * sine
        by_first, by_second = 0.5 * chord * across - slope * along, 0.5 * chord * across + slope * along
        faster = change[t - 1] if t >= 1 else 0.0
        turned = change[steps - 3 + t] if t >= 2 else 0.0
        after = change[steps - 2 + t] if 1 <= t < steps - 1 else 0.0
        both = -way * (curve + 0.25 * chord) * along
        twice = way * (curve - 0.25 * chord) * along
        if t >= 1:
            by[t - 1] += dt * (by_first * turned + by_second * after)
        if t >= 2:
            by[steps - 3 + t] += dt * by_first * faster + (twice - way * slope * across) * turned + both * after
        if 1 <= t < steps - 1:
            by[steps - 2 + t] += dt * by_second * faster + both * turned + (twice + way * slope * across) * after
