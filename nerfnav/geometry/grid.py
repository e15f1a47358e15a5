"""Values on the nodes of a regular grid, and trilinear interpolation between them in torch.

Nodes stand on the box's borders: node (i, j, k) lies at lower + (i, j, k) * spacing with
spacing = size / (shape - 1). Grid coordinates g = (p - lower) / spacing run from 0 to shape - 1.
"""

import math

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from nerfnav.geometry.box import Box

Values = Float[Tensor, "nx ny nz c"]


def shape_for(box: Box, spacing: float) -> tuple[int, int, int]:
    """Numbers of nodes along x, y, z whose distance is as near to `spacing` [m] as the box allows (2 at least)."""
    x, y, z = (max(2, math.floor(length / spacing + 0.5) + 1) for length in box.size.tolist())
    return x, y, z


def spacing_of(box: Box, shape: tuple[int, int, int]) -> Float[Tensor, "3"]:
    """Distances of neighbouring nodes along x, y, z [m]."""
    return box.size / (torch.tensor(shape, device=box.size.device) - 1)


def node_positions(box: Box, shape: tuple[int, int, int]) -> Float[Tensor, "nx ny nz 3"]:
    """World positions of all nodes [m]."""
    axes = [
        torch.linspace(low, high, count)
        for low, high, count in zip(box.lower.tolist(), box.upper.tolist(), shape, strict=True)
    ]
    return torch.stack(torch.meshgrid(*axes, indexing="ij"), -1)


def trilinear(values: Values, box: Box, points: Float[Tensor, "*batch 3"]) -> Float[Tensor, "*batch c"]:
    """Interpolate node values at world points [m]; points outside take the value at the nearest border.

    Differentiable in `values` and, twice, in `points` (only the mixed second derivatives are not zero).
    """
    nx, ny, nz, channels = values.shape
    cell, weights = cells_of(box, (nx, ny, nz), points)
    base = (cell[:, 0] * ny + cell[:, 1]) * nz + cell[:, 2]
    nodes = values.reshape(-1, channels)[base[:, None] + corner_offsets(ny, nz).to(base.device)]
    return (weights[..., None] * nodes.to(points)).sum(1).reshape(*points.shape[:-1], channels)


def cells_of(
    box: Box, shape: tuple[int, int, int], points: Float[Tensor, "*batch 3"]
) -> tuple[Int[Tensor, "n 3"], Float[Tensor, "n 8"]]:
    """The cells (i, j, k) of a grid that hold points [m], and the trilinear weights of their corners, z fastest."""
    last = torch.tensor(shape, device=points.device) - 1
    lower, size = box.lower.to(points), box.size.to(points)
    coordinates = (points - lower) * (last / size)
    coordinates = torch.minimum(coordinates.clamp_min(0), last.to(points)).reshape(-1, 3)
    cell = torch.minimum(coordinates.detach().long(), last - 1)
    x, y, z = (coordinates - cell).unbind(-1)
    along_x, along_y, along_z = (torch.stack([1 - part, part], -1) for part in (x, y, z))
    weights = along_x[:, :, None, None] * along_y[:, None, :, None] * along_z[:, None, None, :]
    return cell, weights.reshape(-1, 8)


def corner_offsets(ny: int, nz: int) -> Int[Tensor, "8"]:
    """Offsets of the corners of a cell from its first one in a flat grid with rows of ny x nz nodes, z fastest."""
    return torch.tensor([(i * ny + j) * nz + k for i in (0, 1) for j in (0, 1) for k in (0, 1)])


def dilate_nodes(chosen: Bool[Tensor, "nx ny nz"]) -> Bool[Tensor, "nx ny nz"]:
    """Dilate a mask on a grid by one node along each axis and diagonal."""
    for axis, count in enumerate(chosen.shape):  # one after the other: 50 times as fast as a cube's maximum
        before, chosen = chosen, chosen.clone()
        chosen.narrow(axis, 1, count - 1).logical_or_(before.narrow(axis, 0, count - 1))
        chosen.narrow(axis, 0, count - 1).logical_or_(before.narrow(axis, 1, count - 1))
    return chosen
