"""Moments of densities on a grid, and the grid that has given ones.

With hat functions h_i, one for each node, T_i = integral h_i rho; see nerfnav/field/bake.py.
"""

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.compiled import default_threads, threads
from nerfnav.field.kernels.fit import add_moments
from nerfnav.field.voxel import DENSITY_SCALE, EMPTY_RAW

_QUARTERS = ((0.75, 0.25), (0.25, 0.75))  # weights of a cell's two nodes at its two points along an axis
Grid = Float[Tensor, "nx ny nz"]
Refined = Float[Tensor, "fx fy fz"]  # two points along each edge of each cell


def fitted(targets: Grid, sweeps: int, empty: float) -> Grid:
    """Raw densities whose moments are `targets`; nodes with less than `empty` [1/m] are empty."""
    least = 0.1 * empty
    start = torch.special.expm1((targets / DENSITY_SCALE).clamp(1e-7, 30)).log()
    raw = torch.where(targets > least, start, torch.full_like(start, EMPTY_RAW))
    with threads(default_threads()):
        for _ in range(sweeps):
            change = ((targets + least) / (moments_of(raw) + least)).log().clamp(-1.5, 1.5)
            raw = torch.where(targets > least, (raw + change).clamp(EMPTY_RAW, 8.0), raw)
    dense = DENSITY_SCALE * torch.nn.functional.softplus(raw)
    return torch.where(dense < empty, torch.full_like(raw, EMPTY_RAW), raw)


def moments_of(raw: Grid) -> Grid:
    """`moments` of the density of a grid with these raw values, compiled."""
    sums = np.zeros(raw.shape, np.float32)
    add_moments(raw.contiguous().numpy(), np.float32(DENSITY_SCALE), sums)
    # weights add up to 2 along each axis, and to 1 at its ends
    x, y, z = (torch.cat([torch.ones(1), torch.full((count - 2,), 2.0), torch.ones(1)]) for count in raw.shape)
    return torch.from_numpy(sums) / (x[:, None, None] * y[:, None] * z)


def refined(nodes: Grid) -> Refined:
    """Values between nodes: two along each edge of each cell, a quarter of it from its ends."""
    for axis in range(3):
        first, second = nodes.narrow(axis, 0, nodes.shape[axis] - 1), nodes.narrow(axis, 1, nodes.shape[axis] - 1)
        pairs = torch.stack([a * first + b * second for a, b in _QUARTERS], axis + 1)
        nodes = pairs.flatten(axis, axis + 1)
    return nodes


def moments(points: Refined) -> Grid:
    """Means of values at the points of `refined`, weighted by each node's hat function: its adjoint, normalised."""
    for axis in range(3):
        cells = points.unflatten(axis, (-1, 2))
        parts, weights = [], []
        for side in (0, 1):
            mixed = sum(pair[side] * cells.select(axis + 1, index) for index, pair in enumerate(_QUARTERS))
            assert isinstance(mixed, Tensor)
            empty = torch.zeros_like(mixed.narrow(axis, 0, 1))
            ones = torch.ones(cells.shape[axis])
            parts.append(torch.cat([mixed, empty] if side == 0 else [empty, mixed], axis))
            weights.append(torch.nn.functional.pad(ones, (0, 1) if side == 0 else (1, 0)))
        column = [1, 1, 1]
        column[axis] = -1
        points = (parts[0] + parts[1]) / (weights[0] + weights[1]).reshape(column)
    return points
