"""SO(3) in scalars for compiled code: twins of so3.py, which calls them where it needs no derivative."""

import math

import numpy as np

from nerfnav.core.jit import kernel


@kernel()
def cross(a, b, out):
    """out = a x b."""
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@kernel()
def log_between(first, second, theta):
    """theta = Log(first' second), by the quaternion, well conditioned up to angle pi."""
    trace = _entry(first, second, 0, 0) + _entry(first, second, 1, 1) + _entry(first, second, 2, 2)
    theta[0] = _entry(first, second, 2, 1) - _entry(first, second, 1, 2)
    theta[1] = _entry(first, second, 0, 2) - _entry(first, second, 2, 0)
    theta[2] = _entry(first, second, 1, 0) - _entry(first, second, 0, 1)
    if trace > 0.0:
        w = 0.5 * math.sqrt(1.0 + trace)
        for i in range(3):
            theta[i] *= 0.25 / w
    else:
        w = _by_largest(first, second, theta)
    sine = math.sqrt(theta[0] ** 2 + theta[1] ** 2 + theta[2] ** 2)
    scale = 2.0 + sine * sine / 3.0 if sine < 1e-6 else 2.0 * math.atan2(sine, w) / sine
    for axis in range(3):
        theta[axis] *= scale


@kernel()
def _entry(first, second, i, j):
    """An entry of first' second: each where it is needed, for an array would be taken from memory at each call."""
    return first[0, i] * second[0, j] + first[1, i] * second[1, j] + first[2, i] * second[2, j]


@kernel()
def _by_largest(first, second, theta):
    """Turn theta, what first' second has beside its diagonal, into a quaternion's vector; returns its scalar."""
    m = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            m[i, j] = _entry(first, second, i, j)
    i = 0
    if m[1, 1] > m[0, 0]:
        i = 1
    if m[2, 2] > m[i, i]:
        i = 2
    j, k = (i + 1) % 3, (i + 2) % 3
    largest = 0.5 * math.sqrt(max(1.0 + m[i, i] - m[j, j] - m[k, k], 1e-12))
    w = 0.25 * theta[i] / largest
    theta[i], theta[j], theta[k] = (
        largest, 0.25 * (m[i, j] + m[j, i]) / largest, 0.25 * (m[i, k] + m[k, i]) / largest,
    )  # fmt: skip
    if w < 0.0:
        w = -w
        for axis in range(3):
            theta[axis] = -theta[axis]
    return w


@kernel()
def inverse_left_jacobian(theta, sign, vector, out):
    """out = Jl(theta)^-1 vector for sign = 1, Jr(theta)^-1 vector for sign = -1 (Sola et al. 2018, Eqs. 144, 146)."""
    squared = theta[0] ** 2 + theta[1] ** 2 + theta[2] ** 2
    if squared < 1e-4:
        second = 1.0 / 12.0 + squared / 720.0
    else:
        angle = math.sqrt(squared)
        second = 1.0 / squared - (1.0 + math.cos(angle)) / (2.0 * angle * math.sin(angle))
    x = theta[1] * vector[2] - theta[2] * vector[1]
    y = theta[2] * vector[0] - theta[0] * vector[2]
    z = theta[0] * vector[1] - theta[1] * vector[0]
    half = sign * 0.5
    out[0] = vector[0] - half * x + second * (theta[1] * z - theta[2] * y)
    out[1] = vector[1] - half * y + second * (theta[2] * x - theta[0] * z)
    out[2] = vector[2] - half * z + second * (theta[0] * y - theta[1] * x)


@kernel()
def product(first, second, out):
    """out = first @ second, of 3 x 3."""
    for i in range(3):
        for j in range(3):
            out[i, j] = first[i, 0] * second[0, j] + first[i, 1] * second[1, j] + first[i, 2] * second[2, j]


@kernel()
def turned(rotation, x, y, z, out):
    """out = rotation Exp((x, y, z)) (Rodrigues)."""
    squared = x * x + y * y + z * z
    angle = math.sqrt(squared)
    if squared < 1e-12:
        once, twice = 1.0 - squared / 6.0, 0.5 - squared / 24.0
    else:
        once, twice = math.sin(angle) / angle, (1.0 - math.cos(angle)) / squared
    turn = np.empty((3, 3))
    turn[0, 0], turn[1, 1], turn[2, 2] = (
        1.0 - twice * (y * y + z * z), 1.0 - twice * (x * x + z * z), 1.0 - twice * (x * x + y * y),
    )  # fmt: skip
    turn[0, 1], turn[0, 2], turn[1, 2] = twice * x * y - once * z, twice * x * z + once * y, twice * y * z - once * x
    turn[1, 0], turn[2, 0], turn[2, 1] = twice * x * y + once * z, twice * x * z - once * y, twice * y * z + once * x
    product(rotation, turn, out)


@kernel()
def exponentials(thetas, rotations):
    """Fill `rotations` (n, 3, 3) with Exp of `thetas` (n, 3)."""
    one = np.eye(3)
    for n in range(thetas.shape[0]):
        turned(one, thetas[n, 0], thetas[n, 1], thetas[n, 2], rotations[n])


@kernel()
def logarithms(rotations, thetas):
    """Fill `thetas` (n, 3) with Log of `rotations` (n, 3, 3)."""
    one = np.eye(3)
    for n in range(rotations.shape[0]):
        log_between(one, rotations[n], thetas[n])
