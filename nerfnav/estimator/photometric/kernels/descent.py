"""Descent of camera poses in one call: twin of `minimise` in levenberg_marquardt.py, whose notation holds here.

A row of the Jacobian by the camera's motion in the world's axes, g = (by centre, by turn), becomes one by the body's
tangent through M = [I, -(R m)^ R; 0, R] with m the camera's place in the body; so the sums are made of g, and M is
applied to them once: J'WJ = M' (sum w g g') M.

Where a pose has hardly moved since its rays were last followed from the camera on, they are followed from a little
before the first density that they met then. A step that is too small to matter is taken without looking again.

`slopes` gives the derivatives alone: the information of pixels about the motion of a camera.
"""

import math

import numpy as np

from nerfnav.core.jit import kernel
from nerfnav.estimator.photometric.kernels.levenberg_marquardt import (
    LEAST_DAMPING,
    MOST_DAMPING,
    damped_step,
    move,
    stretched,
)
from nerfnav.estimator.photometric.kernels.probe import center, turn
from nerfnav.field.kernels.pose_descent import ray_scratch, see_ray
from nerfnav.geometry.linear import copy_matrix, multiply
from nerfnav.geometry.rotations import inverse_left_jacobian, log_between, product

NEAR = 3.0
"""How far a pose may move before its rays are followed from the camera again [steps of a ray]."""
LEEWAY = 4.0
"""How far before the density of last time rays begin, in lengths that their points have moved: surfaces lie aslant."""


@kernel()
def descend(grid, sight, prior, settings, trace, held, moved):
    """Improve n poses from those in the first stage of `trace`; returns how many stages the longest descent has.

    `grid` as `see_ray` has it; `sight` is (directions in the camera (m, 3), colours (m, 3), R and p of the mount);
    `prior` (information (8, 8), mean rotation, mean position, whether there is a mean, kappa, slack); `settings`
    (iterations, damping, robust, settled, stretch); `trace` (rotations, positions, exposures, cost, process, residual,
    change, seen, known, slope), each (iterations + 1, n, ...), what was tried in each stage. `held` (iterations + 1, n)
    is filled with the stage whose trial each pose holds then, and `moved` with how far the last step went.
    """
    iterations, damping, _, settled, most = settings
    pixels = sight[0].shape[0]
    rows, first = np.empty((9, 3 * pixels), np.float32), np.empty(pixels, np.float32)
    trust = np.empty(3 * pixels, np.float32)
    anchor, step, before, longest, length = np.empty((4, 3)), np.empty(8), np.empty(8), 0, 0.0
    for n in range(held.shape[1]):
        weight, best, stage, going, stretch = damping, 0, 0, True, 0.0
        for axis in range(3):
            anchor[3, axis] = np.inf  # nothing is known yet
        for later in range(iterations + 1):
            held[later, n], moved[later, n] = 0, 0.0
        while going:
            if stage > 0:
                damped_step(trace[7][best, n], trace[8][best, n], trace[9][best, n], weight, step)
                stretch = stretched(trace[7][best, n], trace[8][best, n], before, stretch, step, most)
                move(trace, (best, n), step, (stage, n))
                for i in range(6):
                    length = abs(step[i]) if i == 0 else max(length, abs(step[i]))
                if length < settled:
                    _settle(trace, (best, stage, n), prior)
                    held[stage, n], moved[stage, n], best, stage = stage, length, stage, stage + 1
                    break
            _evaluate(grid, sight, prior, settings[2], (trace, stage, n), (rows, first, anchor, trust))
            if stage > 0:
                if trace[3][stage, n] < trace[3][best, n]:
                    best, weight = stage, max(0.2 * weight, LEAST_DAMPING)
                    for i in range(6):
                        moved[stage, n] = max(moved[stage, n], abs(step[i]))
                else:
                    weight = min(5.0 * weight, MOST_DAMPING) if stretch == 1.0 else weight
                    stretch = 0.0
            held[stage, n] = best
            going = stage < iterations and (stage == 0 or not moved[stage, n] < settled)
            stage += 1
        longest = max(longest, stage)
        for later in range(stage, iterations + 1):
            held[later, n] = best
    return longest


@kernel()
def _settle(trace, place, prior):
    """Take a step too small to look again: what the picture says stays, what the prior says follows."""
    best, stage, n = place
    trace[3][stage, n] = trace[3][best, n]
    copy_matrix(trace[5][best, n], trace[5][stage, n])
    copy_matrix(trace[7][best, n], trace[7][stage, n])
    for i in range(8):
        trace[9][stage, n, i] = trace[9][best, n, i]
    rotation, position, exposure = trace[0][stage, n], trace[1][stage, n], trace[2][stage, n]
    change, known = trace[6][stage, n], trace[8][stage, n]
    trace[4][stage, n] = pulled(prior, rotation, position, exposure, change, known, np.zeros(8))


@kernel()
def _evaluate(grid, sight, prior, robust, place, scratch):
    """Fill cost, residual, curvature and slope of a stage from its guess."""
    trace, stage, n = place
    rotation, position, exposure = trace[0][stage, n], trace[1][stage, n], trace[2][stage, n]
    guess, bounds = (rotation, position, exposure), (robust, prior[5] if stage == 0 else -1.0)
    loss = look(grid, sight, guess, bounds, trace[5][stage, n], scratch)
    seen, known, slope = trace[7][stage, n], trace[8][stage, n], trace[9][stage, n]
    sums(scratch[0], rotation, sight[3], prior[4], seen, slope)
    process = pulled(prior, rotation, position, exposure, trace[6][stage, n], known, slope)
    trace[3][stage, n], trace[4][stage, n] = prior[4] * loss + process, process


@kernel()
def look(grid, sight, guess, bounds, residuals, scratch):
    """Follow the rays of all pixels: fill residuals (m, 3) and rows (9, 3 m); returns the sum of the robust squares.

    Rows hold sqrt(w) times the derivatives by the camera's motion (6), by gain and bias, and the residual. `bounds` are
    Huber's and the slack from which trust w is made (see levenberg_marquardt.py); where that is negative, trust is that
    of before.
    """
    directions, colors = sight[0], sight[1]
    rotation, position, exposure = guess
    rows, first, anchor, trust = scratch
    bound, slack = np.float32(bounds[0]), np.float32(bounds[1])
    camera = np.empty((3, 3))
    product(rotation, sight[2], camera)
    gain, bias = np.float32(1.0 + exposure[0]), np.float32(exposure[1])
    origin, way, march = np.empty(3, np.float32), np.empty(3, np.float32), ray_scratch()
    color, jacobian = np.empty(3, np.float32), np.empty((3, 6), np.float32)
    center(rotation, position, sight[3], origin)
    fresh, moved, swung = _moved(grid, rotation, position, anchor)
    step, loss = grid[5], 0.0
    for pixel in range(directions.shape[0]):
        turn(camera, directions[pixel], way)
        begin = first[pixel] - np.float32(LEEWAY) * (moved + swung * first[pixel]) - np.float32(2.0) * step
        met = see_ray(grid, (origin, way), np.float32(0.0) if fresh else begin, color, jacobian, march)
        if fresh:
            first[pixel] = met
        for channel in range(3):
            row = 3 * pixel + channel
            error = gain * color[channel] + bias - colors[pixel, channel]
            size = abs(error)
            residuals[pixel, channel] = error
            near = size <= bound
            if slack >= np.float32(0.0):
                steep = slack * gain
                steep *= steep * (jacobian[channel, 0] ** 2 + jacobian[channel, 1] ** 2 + jacobian[channel, 2] ** 2)
                trust[row] = np.float32(1.0) / (np.float32(1.0) + steep)
            loss += trust[row] * (error * error if near else bound * (np.float32(2.0) * size - bound))
            root = np.float32(math.sqrt(trust[row] if near else trust[row] * bound / size))
            for i in range(6):
                rows[i, row] = root * gain * jacobian[channel, i]
            rows[6, row], rows[7, row], rows[8, row] = root * color[channel], root, root * error
    return loss * _evened(trust, rows) if slack >= np.float32(0.0) else loss


@kernel()
def _evened(trust, rows):
    """Make the mean of `trust` 1, and rows what they are with that; returns by how much trust grew."""
    total = np.float32(0.0)
    for row in range(trust.shape[0]):
        total += trust[row]
    growth = np.float32(trust.shape[0]) / total
    root = np.float32(math.sqrt(growth))
    for row in range(trust.shape[0]):
        trust[row] *= growth
    for i in range(rows.shape[0]):
        for row in range(rows.shape[1]):
            rows[i, row] *= root
    return growth


@kernel()
def _moved(grid, rotation, position, anchor):
    """Return whether rays must be followed from the camera, whose pose is then kept, and how far that moved, turned."""
    moved, swung = 0.0, 0.0
    for axis in range(3):
        moved += (position[axis] - anchor[3, axis]) ** 2
        for other in range(3):
            swung += (rotation[axis, other] - anchor[axis, other]) ** 2
    moved, swung = math.sqrt(moved), math.sqrt(0.5 * swung)
    fresh = not moved + swung < NEAR * grid[5]
    if fresh:
        for axis in range(3):
            anchor[3, axis] = position[axis]
            for other in range(3):
                anchor[axis, other] = rotation[axis, other]
    return fresh, np.float32(moved), np.float32(swung)


@kernel()
def sums(rows, rotation, mount, kappa, seen, slope):
    """Fill the picture's part of curvature and slope from the rows."""
    total = np.empty((9, 9))
    for i in range(9):
        for j in range(i, 9):
            dot = np.float32(0.0)
            for row in range(rows.shape[1]):
                dot += rows[i, row] * rows[j, row]
            total[i, j] = total[j, i] = kappa * dot
    turn = np.zeros((9, 9))  # from the body's tangent to the camera's motion
    arm = np.empty(3)
    for axis in range(3):
        arm[axis] = rotation[axis, 0] * mount[0] + rotation[axis, 1] * mount[1] + rotation[axis, 2] * mount[2]
        turn[axis, axis] = 1.0
        for other in range(3):
            turn[3 + axis, 3 + other] = rotation[axis, other]
    for other in range(3):  # -(R m) x (column of R)
        x, y, z = rotation[0, other], rotation[1, other], rotation[2, other]
        turn[0, 3 + other] = arm[2] * y - arm[1] * z
        turn[1, 3 + other] = arm[0] * z - arm[2] * x
        turn[2, 3 + other] = arm[1] * x - arm[0] * y
    turn[6, 6] = turn[7, 7] = turn[8, 8] = 1.0
    half, whole = np.empty((9, 9)), np.empty((9, 9))
    multiply(total, turn, half)
    multiply(turn.T, half, whole)
    for i in range(8):
        slope[i] = whole[i, 8]
        for j in range(8):
            seen[i, j] = whole[i, j]


@kernel()
def pulled(prior, rotation, position, exposure, change, known, slope):
    """Fill how far a guess is from what is known, and add what that pulls; returns the process term."""
    information, mean_rotation, mean_position, has_mean = prior[:4]
    derivative, turn, unit, column = np.zeros((8, 8)), np.zeros(3), np.zeros(3), np.empty(3)
    for i in range(8):
        change[i], derivative[i, i] = 0.0, 1.0
    change[6], change[7] = exposure[0], exposure[1]
    if has_mean:
        log_between(mean_rotation, rotation, turn)
        for axis in range(3):
            change[axis], change[3 + axis] = position[axis] - mean_position[axis], turn[axis]
        for other in range(3):
            for axis in range(3):
                unit[axis] = 1.0 if axis == other else 0.0
            inverse_left_jacobian(turn, -1.0, unit, column)
            for axis in range(3):
                derivative[3 + axis, 3 + other] = column[axis]
    push, process, half = np.zeros(8), 0.0, np.empty((8, 8))
    multiply(information, derivative, half)
    multiply(derivative.T, half, known)
    for i in range(8):
        for j in range(8):
            push[i] += information[i, j] * change[j]
        process += push[i] * change[i]
    for i in range(8):
        for j in range(8):
            slope[i] += derivative[j, i] * push[j]
    return process


@kernel()
def slopes(grid, sight, rotation, position):
    """Derivatives (6, 3 m) of m pixels' colours by the camera's motion in the world's axes, centre and turn, at a body
    pose; `grid` and `sight` as `descend` has them."""
    pixels = sight[0].shape[0]
    rows, first = np.empty((9, 3 * pixels), np.float32), np.empty(pixels, np.float32)
    anchor, residuals = np.full((4, 3), np.inf), np.empty((pixels, 3), np.float32)
    scratch = rows, first, anchor, np.ones(3 * pixels, np.float32)
    look(grid, sight, (rotation, position, np.zeros(2)), (np.inf, -1.0), residuals, scratch)
    return rows[:6]
