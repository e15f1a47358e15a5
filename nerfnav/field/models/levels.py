"""Resolution pyramid of a voxel field: each level has nodes twice as far apart as the one before.

What is averaged is the share of light that a new voxel's length h' would stop, so that a surface stays opaque but
does not swell, and colours are averaged by it, so that the empty space before a surface does not stain it:

    a = 1 - exp(-rho h'),   rho' = -log(1 - mean(a)) / h',   c' = mean(a c) / mean(a)

with weights 1/4, 1/2, 1/4 along each axis.

A picture reduced by 2^k looks about like level k: a voxel of it covers about as many of its pixels.
"""

from dataclasses import replace
from functools import lru_cache

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.field.core.occupancy import DENSITY_SCALE, EMPTY_RAW, inverse_softplus
from nerfnav.field.core.protocol import Field
from nerfnav.field.models.voxel import VoxelField

_NOTHING, _OPAQUE = 1e-5, 1 - 1e-4
"""Shares of light that count as none and as all."""
_FEWEST_NODES = 9
"""A grid with fewer nodes along its shortest edge is not made coarser: the place would dissolve."""


def build_levels(field: Field, count: int) -> tuple[Field, ...]:
    """The field itself and `count` - 1 coarser ones; the last one repeats where there is none any coarser.

    Fields without a grid have no coarser ones: they are taken as they are at every level.
    """
    levels = [field]
    while len(levels) < count:
        last = levels[-1]
        levels.append(coarser(last) if isinstance(last, VoxelField) else last)
    return tuple(levels)


@lru_cache(maxsize=3)  # the levels of one place: every flight and every search needs them
def coarser(field: VoxelField) -> VoxelField:
    """The field on nodes twice as far apart; the same field where it has too few nodes already."""
    nx, ny, nz = ((nodes - 1 + 1) // 2 + 1 for nodes in field.shape)
    if min(nx, ny, nz) < _FEWEST_NODES:
        return field
    values = _coarser_values(field.values, 2 * float(field.spacing.min()), (nx, ny, nz))
    return replace(field, values=values, evidence=None)  # what was seen matters to planners alone


@lru_cache(maxsize=3)  # a field whose info changes keeps its values
@torch.no_grad()
def _coarser_values(
    values: Float[Tensor, "nx ny nz 4"], length: float, shape: tuple[int, int, int]
) -> Float[Tensor, "mx my mz 4"]:
    raw, colors = values[..., :1], values[..., 1:]
    stopped = -torch.expm1(-length * DENSITY_SCALE * torch.nn.functional.softplus(raw))
    mean, colored = _halved(stopped, shape).clamp_max(_OPAQUE), _halved(stopped * colors, shape)
    coarse_colors = torch.where(mean > _NOTHING, colored / mean.clamp_min(_NOTHING), _halved(colors, shape))
    return torch.cat([raw_of(-torch.log1p(-mean) / length), coarse_colors], -1)


def raw_of(density: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
    """Raw values of densities [1/m]: the inverse of scale * softplus, EMPTY_RAW for those of 0."""
    raw = inverse_softplus(density / DENSITY_SCALE).to(density)
    return torch.where(density > _NOTHING, raw, torch.full_like(raw, EMPTY_RAW))


def _halved(values: Float[Tensor, "nx ny nz c"], shape: tuple[int, int, int]) -> Float[Tensor, "mx my mz c"]:
    """Averages over neighbours, at the nodes of a grid of the new shape over the same box."""
    planes = values.permute(3, 0, 1, 2)[None]
    for axis in (2, 3, 4):
        count = planes.shape[axis]
        before, after = planes.narrow(axis, 0, count - 1), planes.narrow(axis, 1, count - 1)
        between = 0.5 * (before + after)  # twice the mean of two neighbours is 1/4, 1/2, 1/4
        first, last = planes.narrow(axis, 0, 1), planes.narrow(axis, count - 1, 1)
        between = torch.cat([first, between, last], axis)
        planes = 0.5 * (between.narrow(axis, 0, count) + between.narrow(axis, 1, count))
    halved = torch.nn.functional.interpolate(planes, shape, mode="trilinear", align_corners=True)
    return halved[0].permute(1, 2, 3, 0).contiguous()
