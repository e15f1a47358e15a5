"""Rays through the shells around the box: twin of field/surroundings.py, whose notation and equations hold here."""

import math

import numpy as np

from nerfnav.compiled import kernel
from nerfnav.field.kernels.cells import NEGLIGIBLE_RAW, cell_of, corner_weights, interpolate, softplus

RAW_TO_DEPTH = np.float32(2.5)
"""d: optical depth of a shell at a softplus of 1; one shell suffices for a wall."""


@kernel(inline=True)
def shell_count(nodes):
    """How many shells a grid of `nodes` nodes along each edge is asked at."""
    return nodes // 2


@kernel(inline=True)
def cross_shell(position, nodes, start, slope, shape, cell, fraction):
    """Fill cell and fraction of the outer grid where a ray leaves shell `position` + 0.5 (fractions are allowed).

    `start`, `slope` and `shape` are the ray's and the inner grid's. Returns the distance from the ray's origin;
    negative where the ray never is inside that shell.
    """
    one, two, zero = np.float32(1.0), np.float32(2.0), np.float32(0.0)
    shells = np.float32(shell_count(nodes))
    size = shells / (shells - position - np.float32(0.5))
    enter, leave = zero, np.float32(np.inf)
    for axis in range(3):
        per_half = two / np.float32(shape[axis] - 1)
        at, along = per_half * start[axis] - one, per_half * slope[axis]
        if abs(along) < np.float32(1e-9):
            if abs(at) > size:
                return -one
        else:
            first, second = (-size - at) / along, (size - at) / along
            enter, leave = max(enter, min(first, second)), min(leave, max(first, second))
    if leave <= enter:
        return -one
    radius = (two - one / size) / size
    to_grid = np.float32(0.25) * np.float32(nodes - 1)
    for axis in range(3):
        per_half = two / np.float32(shape[axis] - 1)
        contracted = radius * (per_half * (start[axis] + leave * slope[axis]) - one)
        cell[axis], fraction[axis] = cell_of(to_grid * (contracted + two), nodes)
    return leave


@kernel(inline=True)
def see_shells(outer, start, slope, shape, light, scratch, seen):
    """Add colour and depth (4) of all shells, seen through `light`, to `seen`; returns the light that is left.

    `scratch` is (cell, fraction, weights).
    """
    cell, fraction, weights = scratch
    nodes = outer.shape[0]
    shells = shell_count(nodes)
    for shell in range(shells):
        distance = cross_shell(np.float32(shell), nodes, start, slope, shape, cell, fraction)
        if distance < np.float32(0.0):
            continue
        i, j, k = cell[0], cell[1], cell[2]
        corner_weights(fraction[0], fraction[1], fraction[2], weights)
        through = np.float32(0.0)
        if shell + 1 < shells:
            raw = interpolate(outer, 0, i, j, k, weights)
            if raw < NEGLIGIBLE_RAW:
                continue
            through = np.float32(math.exp(-RAW_TO_DEPTH * softplus(raw)))
        weight = light * (np.float32(1.0) - through)
        for channel in range(3):
            seen[channel] += weight * interpolate(outer, channel + 1, i, j, k, weights)
        seen[3] += weight * distance
        light *= through
        if light < np.float32(3e-5):
            break
    return light
