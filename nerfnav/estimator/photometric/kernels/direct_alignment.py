"""Direct alignment of a picture with points of known colours, in one call: twin of direct_alignment.py.

Rows and unknowns are those of descent.py beside this file: derivatives by the camera's motion in the world's axes
(centre, turn), by gain and bias, and the residual, all times sqrt(w).
"""

import math

import numpy as np

from nerfnav.core.jit import kernel
from nerfnav.estimator.photometric.kernels.descent import pulled, sums
from nerfnav.estimator.photometric.kernels.levenberg_marquardt import LEAST_DAMPING, MOST_DAMPING, damped_step, move
from nerfnav.geometry.rotations import product

LEAST_DEPTH = 1e-6


@kernel()
def align(scene, prior, settings, state):
    """Improve the first guess in `state` by Levenberg's and Marquardt's steps; returns which of the two is held.

    `scene` is (picture (h, w, 3), points (n, 3) [m], their colours (n, 3), where they showed (n, 2) [pixels] and as
    x / z and y / z (n, 2), lens (n, 2, 2) [pixels], R and p of the mount); `prior` and `settings` as `descend` has
    them, but that the bound of the last step is in standard deviations; `state` (rotations, positions, exposures,
    cost, process, residual, change, seen, known, slope), each (2, ...).
    """
    iterations, weight, robust, settled = settings
    rows, step = np.empty((9, 3 * scene[1].shape[0]), np.float32), np.empty(8)
    held = 0
    _evaluate(scene, prior, robust, state, held, rows)
    for _ in range(iterations):
        seen, known, slope = state[7][held], state[8][held], state[9][held]
        if not damped_step(seen, known, slope, weight, step):
            break
        size = 0.0
        for i in range(8):
            for j in range(8):
                size += step[i] * (seen[i, j] + known[i, j]) * step[j]
        if not size > settled * settled:
            break
        trial = 1 - held
        move(state, held, step, trial)
        _evaluate(scene, prior, robust, state, trial, rows)
        if state[3][trial] < state[3][held]:
            held, weight = trial, max(0.2 * weight, LEAST_DAMPING)
        else:
            weight = min(5.0 * weight, MOST_DAMPING)
    return held


@kernel()
def _evaluate(scene, prior, robust, state, at, rows):
    """Fill cost, residual, curvature and slope of a guess."""
    rotation, position, exposure = state[0][at], state[1][at], state[2][at]
    loss = _compare(scene, rotation, position, exposure, robust, state[5][at], rows)
    seen, known, slope = state[7][at], state[8][at], state[9][at]
    sums(rows, rotation, scene[7], prior[4], seen, slope)
    process = pulled(prior, rotation, position, exposure, state[6][at], known, slope)
    state[3][at], state[4][at] = prior[4] * loss + process, process


@kernel()
def _compare(scene, rotation, position, exposure, robust, residuals, rows):
    """Fill residuals (n, 3) and rows (9, 3 n) from where the points show now; returns the sum of the robust squares."""
    picture, points, colors, shown, flat, lens, mounted, arm = scene
    camera, arms, seen, by = np.empty((3, 3)), np.empty(3), np.empty((3, 3), np.float32), np.empty(3)
    product(rotation, mounted, camera)
    for axis in range(3):
        arms[axis] = rotation[axis, 0] * arm[0] + rotation[axis, 1] * arm[1] + rotation[axis, 2] * arm[2]
    gain, bias, loss = 1.0 + exposure[0], exposure[1], 0.0
    for point in range(points.shape[0]):
        x = points[point, 0] - position[0] - arms[0]
        y = points[point, 1] - position[1] - arms[1]
        z = points[point, 2] - position[2] - arms[2]
        right = camera[0, 0] * x + camera[1, 0] * y + camera[2, 0] * z
        up = camera[0, 1] * x + camera[1, 1] * y + camera[2, 1] * z
        depth = -(camera[0, 2] * x + camera[1, 2] * y + camera[2, 2] * z)
        ahead = depth > LEAST_DEPTH
        per = 1.0 / depth if ahead else 0.0
        a, b = right * per - flat[point, 0], -up * per - flat[point, 1]
        u = shown[point, 0] + lens[point, 0, 0] * a + lens[point, 0, 1] * b
        v = shown[point, 1] + lens[point, 1, 0] * a + lens[point, 1, 1] * b
        _sample(picture, u, v, seen)
        for channel in range(3):
            row = 3 * point + channel
            by_a = seen[channel, 1] * lens[point, 0, 0] + seen[channel, 2] * lens[point, 1, 0]
            by_b = seen[channel, 1] * lens[point, 0, 1] + seen[channel, 2] * lens[point, 1, 1]
            by[0], by[1] = -by_a * per, by_b * per  # by the point's place in the camera
            by[2] = (-by_a * right + by_b * up) * per * per
            error = gain * colors[point, channel] + bias - seen[channel, 0] if ahead else robust
            size = abs(error)
            residuals[point, channel] = error
            loss += size * size if size <= robust else robust * (2.0 * size - robust)
            root = 1.0 if size <= robust else math.sqrt(robust / size)
            hx = root * (camera[0, 0] * by[0] + camera[0, 1] * by[1] + camera[0, 2] * by[2])
            hy = root * (camera[1, 0] * by[0] + camera[1, 1] * by[1] + camera[1, 2] * by[2])
            hz = root * (camera[2, 0] * by[0] + camera[2, 1] * by[1] + camera[2, 2] * by[2])
            rows[0, row], rows[1, row], rows[2, row] = -hx, -hy, -hz
            rows[3, row], rows[4, row], rows[5, row] = hy * z - hz * y, hz * x - hx * z, hx * y - hy * x
            rows[6, row], rows[7, row], rows[8, row] = root * colors[point, channel], root, root * error
    return loss


@kernel()
def _sample(picture, u, v, seen):
    """Fill value and slopes by u and v (3 channels, 3) between pixels' centres; beyond the edge nothing changes."""
    height, width = picture.shape[0], picture.shape[1]
    x, y = min(max(u - 0.5, 0.0), width - 1.0), min(max(v - 0.5, 0.0), height - 1.0)
    i, j = min(int(x), width - 2), min(int(y), height - 2)
    flat_x, flat_y = x != u - 0.5, y != v - 0.5
    x, y = np.float32(x - i), np.float32(y - j)
    for channel in range(3):
        first, second = picture[j, i, channel], picture[j, i + 1, channel]
        third, fourth = picture[j + 1, i, channel], picture[j + 1, i + 1, channel]
        upper, lower = first + x * (second - first), third + x * (fourth - third)
        seen[channel, 0] = upper + y * (lower - upper)
        across = (second - first) + y * ((fourth - third) - (second - first))
        seen[channel, 1] = np.float32(0.0) if flat_x else across
        seen[channel, 2] = np.float32(0.0) if flat_y else lower - upper
