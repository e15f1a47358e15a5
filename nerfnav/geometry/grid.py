"""Values on the nodes of a regular grid, and trilinear interpolation between them in torch.

Nodes stand on the box's borders: node (i, j, k) lies at lower + (i, j, k) * spacing with
spacing = size / (shape - 1). Grid coordinates g = (p - lower) / spacing run from 0 to shape - 1.
"""

import math

import torch
from jaxtyping import Bool, Float
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
    shape = torch.tensor([nx, ny, nz], device=points.device)
    lower, size = box.lower.to(points), box.size.to(points)
    coordinates = (points - lower) * ((shape - 1) / size)
    coordinates = torch.minimum(coordinates.clamp_min(0), (shape - 1).to(points)).reshape(-1, 3)
    cell = torch.minimum(coordinates.detach().long(), shape - 2)
    x, y, z = (coordinates - cell).unbind(-1)
    base = (cell[:, 0] * ny + cell[:, 1]) * nz + cell[:, 2]
    corners = [(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    offsets = torch.tensor([(i * ny + j) * nz + k for i, j, k in corners], device=points.device)
    along_x, along_y, along_z = (torch.stack([1 - part, part], -1) for part in (x, y, z))
    weights = along_x[:, :, None, None] * along_y[:, None, :, None] * along_z[:, None, None, :]
    nodes = values.reshape(-1, channels)[base[:, None] + offsets]
    mixed = (weights.reshape(-1, 8, 1) * nodes.to(points)).sum(1)
    return mixed.reshape(*points.shape[:-1], channels)


def with_neighbours(chosen: Bool[Tensor, "nx ny nz"]) -> Bool[Tensor, "nx ny nz"]:
    """What is chosen on a grid, and all that touches it along an axis or a diagonal."""
    return torch.nn.functional.max_pool3d(chosen[None, None].float(), 3, 1, 1)[0, 0] > 0
