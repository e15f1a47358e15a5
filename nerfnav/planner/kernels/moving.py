"""Kernels of plans among moving boxes: layers of blocked cells, the cheapest path through them, and its smoothing.

Control point i of a uniform cubic B-spline is a layer in time. How far ahead it is in x is given, so that a layer is a
grid over y and z, and its boxes are rectangles. Times are cut into `parts` steps for each layer; the boxes' middles are
given at these, (m, k, 3), and `halves` (k, 3) are enlarged by the robot's.
"""

import numpy as np

from nerfnav.core.jit import kernel

BLOCKED = 255
_NOWHERE = 1e30


@kernel()
def mark_layers(levels, first_layer, ahead, centers, halves, origin, cell, parts, margins):
    """Mark in `levels` (n, ny, nz) the cells that boxes cover in half a layer's time before and after each layer.

    `ahead` (m) is x at each step; step (i - 1) parts is the time of layer i, and `first_layer` the first of the n.
    `origin` is the place of cell 0 in y and z, `cell` its size. Within margins[0] [m] a cell is blocked, within
    margins[1] it costs 1.
    """
    count, ny, nz = levels.shape
    half = parts // 2
    last = ahead.shape[0] - 1
    for layer in range(count):
        middle = (first_layer + layer - 1) * parts
        first, end = max(0, middle - half), min(last, middle + half)
        for step in range(first, end):
            for box in range(halves.shape[0]):
                before, after = ahead[step] - centers[step, box, 0], ahead[step + 1] - centers[step + 1, box, 0]
                wide = halves[box, 0] + margins[0]
                if min(before, after) > wide or max(before, after) < -wide:
                    continue
                for kind in range(1, -1, -1):
                    tall, far = halves[box, 1] + margins[kind], halves[box, 2] + margins[kind]
                    y0 = min(centers[step, box, 1], centers[step + 1, box, 1]) - tall
                    y1 = max(centers[step, box, 1], centers[step + 1, box, 1]) + tall
                    z0 = min(centers[step, box, 2], centers[step + 1, box, 2]) - far
                    z1 = max(centers[step, box, 2], centers[step + 1, box, 2]) + far
                    low_y, high_y = int(np.ceil((y0 - origin[0]) / cell)), int(np.floor((y1 - origin[0]) / cell))
                    low_z, high_z = int(np.ceil((z0 - origin[1]) / cell)), int(np.floor((z1 - origin[1]) / cell))
                    for i in range(max(0, low_y), min(ny - 1, high_y) + 1):
                        for j in range(max(0, low_z), min(nz - 1, high_z) + 1):
                            if kind == 0:
                                levels[layer, i, j] = BLOCKED
                            elif levels[layer, i, j] == 0:
                                levels[layer, i, j] = 1


@kernel()
def cheapest_layers(levels, start, goal, reach, near_cost, found):
    """Find the cheapest path from cell `start` in layer 0 to cell `goal` in the last one; write it to `found` (n, 2).

    A step moves by at most `reach` cells along y and z, and costs the squares of both; a cell of level 1 costs
    `near_cost`. Returns the cost; 1e30 where there is no path. Moves along y and z are found one after the other.
    """
    count, ny, nz = levels.shape
    cost = np.full((ny, nz), np.float32(_NOWHERE))
    cost[start[0], start[1]] = 0.0
    between = np.empty((ny, nz), np.float32)
    moves = np.zeros((2, count, ny, nz), np.int8)
    for layer in range(1, count):
        for i in range(ny):
            for j in range(nz):
                best, move = np.float32(_NOWHERE), 0
                for step in range(-reach[0], reach[0] + 1):
                    if 0 <= i - step < ny:
                        total = cost[i - step, j] + np.float32(step * step)
                        if total < best:
                            best, move = total, step
                between[i, j] = best
                moves[0, layer, i, j] = move
        for i in range(ny):
            for j in range(nz):
                best, move = np.float32(_NOWHERE), 0
                if levels[layer, i, j] != BLOCKED:
                    for step in range(-reach[1], reach[1] + 1):
                        if 0 <= j - step < nz:
                            total = between[i, j - step] + np.float32(step * step)
                            if total < best:
                                best, move = total, step
                    best += np.float32(near_cost * levels[layer, i, j])
                cost[i, j] = best
                moves[1, layer, i, j] = move
    i, j = goal
    least = cost[i, j]
    if least >= np.float32(0.5 * _NOWHERE):
        return _NOWHERE
    for layer in range(count - 1, -1, -1):
        found[layer, 0], found[layer, 1] = i, j
        j -= moves[1, layer, i, j]
        i -= moves[0, layer, i, j]
    return float(least)


@kernel()
def sample_spline(points, parts, out):
    """Write a uniform cubic B-spline through control points (n, 3) to `out` ((n - 3) parts + 1, 3), at equal steps."""
    for step in range(out.shape[0]):
        knot = min(step // parts, points.shape[0] - 4)
        u = (step - knot * parts) / parts
        a, b = (1.0 - u) ** 3 / 6.0, (3.0 * u**3 - 6.0 * u**2 + 4.0) / 6.0
        c, d = (-3.0 * u**3 + 3.0 * u**2 + 3.0 * u + 1.0) / 6.0, u**3 / 6.0
        for axis in range(3):
            near = a * points[knot, axis] + b * points[knot + 1, axis]
            out[step, axis] = near + c * points[knot + 2, axis] + d * points[knot + 3, axis]


@kernel()
def first_contact(path, begin, centers, halves, margin):
    """Index of the first step from `begin` on at which a path (m, 3) comes within `margin` of a box; -1: none.

    Between two times path and boxes move in straight lines, and are tested as such, by slabs.
    """
    for step in range(begin, path.shape[0] - 1):
        for box in range(halves.shape[0]):
            enter, leave = 0.0, 1.0
            for axis in range(3):
                wide = halves[box, axis] + margin
                before = path[step, axis] - centers[step, box, axis]
                change = path[step + 1, axis] - centers[step + 1, box, axis] - before
                if abs(change) < 1e-12:
                    if abs(before) > wide:
                        leave = -1.0
                        break
                    continue
                first, second = (-wide - before) / change, (wide - before) / change
                enter, leave = max(enter, min(first, second)), min(leave, max(first, second))
                if enter > leave:
                    break
            if enter <= leave:
                return step
    return -1


@kernel()
def list_near(ahead, centers, halves, margin, starts, near):
    """List for each step the boxes within `margin` of it along x: those of step m are near[starts[m] : starts[m + 1]].

    Returns how many there are, which may be more than `near` has room for.
    """
    count = 0
    for step in range(ahead.shape[0]):
        starts[step] = count
        for box in range(halves.shape[0]):
            if abs(ahead[step] - centers[step, box, 0]) <= halves[box, 0] + margin:
                if count < near.shape[0]:
                    near[count] = box
                count += 1
    starts[ahead.shape[0]] = count
    return count


@kernel()
def _depth(points, index, parts, world, push):
    """Sum the squared depths in boxes of the segments that control point `index` moves; the way out is in `push`."""
    centers, halves, starts, near, margin = world
    total, deepest = 0.0, 0.0
    push[0], push[1] = 0.0, 0.0
    for knot in range(max(0, index - 3), min(index, points.shape[0] - 4) + 1):
        for part in range(parts):
            step = knot * parts + part
            if starts[step] == starts[step + 1]:
                continue
            u = part / parts
            a, b = (1.0 - u) ** 3 / 6.0, (3.0 * u**3 - 6.0 * u**2 + 4.0) / 6.0
            c, d = (-3.0 * u**3 + 3.0 * u**2 + 3.0 * u + 1.0) / 6.0, u**3 / 6.0
            y = a * points[knot, 1] + b * points[knot + 1, 1] + c * points[knot + 2, 1] + d * points[knot + 3, 1]
            z = a * points[knot, 2] + b * points[knot + 1, 2] + c * points[knot + 2, 2] + d * points[knot + 3, 2]
            for at in range(starts[step], starts[step + 1]):
                box = near[at]
                off_y, off_z = y - centers[step, box, 1], z - centers[step, box, 2]
                in_y, in_z = halves[box, 1] + margin - abs(off_y), halves[box, 2] + margin - abs(off_z)
                if in_y > 0.0 and in_z > 0.0:
                    depth = min(in_y, in_z)
                    total += depth * depth
                    if depth > deepest:
                        deepest = depth
                        push[0] = 0.0 if in_z < in_y else (depth if off_y > 0.0 else -depth)
                        push[1] = 0.0 if in_z >= in_y else (depth if off_z > 0.0 else -depth)
    return total


@kernel()
def _roughness(points, index, axis):
    """Sum of squared third differences that control point `index` is in."""
    total = 0.0
    for first in range(max(0, index - 3), min(index, points.shape[0] - 4) + 1):
        inner = 3.0 * (points[first + 1, axis] - points[first + 2, axis])
        third = points[first + 3, axis] + inner - points[first, axis]
        total += third * third
    return total


@kernel()
def _downhill(points, index, axis):
    """Change of control point `index` that makes its third differences least."""
    slope, curvature = 0.0, 0.0
    for first in range(max(0, index - 3), min(index, points.shape[0] - 4) + 1):
        inner = 3.0 * (points[first + 1, axis] - points[first + 2, axis])
        third = points[first + 3, axis] + inner - points[first, axis]
        place = index - first
        weight = -1.0 if place == 0 else (3.0 if place == 1 else (-3.0 if place == 2 else 1.0))
        slope += third * weight
        curvature += weight * weight
    return -slope / curvature


@kernel()
def smooth_points(points, fixed, steps, bounds, parts, world, weight, sweeps):
    """Lower the third differences of y and z of control points (n, 3) in place, and move them out of boxes.

    The first fixed[0] and the last fixed[1] stay. Neighbours stay within steps (2) of each other along y and z, and
    all within `bounds` (2, 2). `world` = centers, halves, starts and near of `list_near`, and the margin to keep [m];
    `weight` is that of squared depths. A change is taken only where the sum is less than before.
    """
    push = np.empty(2)
    aside = np.empty(2)
    for sweep in range(sweeps):
        for at in range(fixed[0], points.shape[0] - fixed[1]):
            index = at if sweep % 2 == 0 else points.shape[0] - fixed[1] - 1 - (at - fixed[0])
            now = weight * _depth(points, index, parts, world, push)
            for axis in range(1, 3):
                rough = _roughness(points, index, axis)
                before = points[index, axis]
                smoother = _downhill(points, index, axis)
                for attempt in range(4):
                    change = smoother * (1.0 if attempt == 0 else 0.4)
                    if attempt >= 2:
                        change = push[axis - 1] * (1.6 if attempt == 2 else 0.8)
                    value = min(max(before + change, bounds[axis - 1, 0]), bounds[axis - 1, 1])
                    if (
                        abs(value - before) < 1e-6
                        or abs(value - points[index - 1, axis]) > steps[axis - 1]
                        or abs(value - points[index + 1, axis]) > steps[axis - 1]
                    ):
                        continue
                    points[index, axis] = value
                    then_rough = _roughness(points, index, axis)
                    if then_rough < rough + now:
                        then = weight * _depth(points, index, parts, world, aside)
                        if then + then_rough < now + rough - 1e-12:
                            now = then
                            push[0], push[1] = aside[0], aside[1]
                            break
                    points[index, axis] = before
