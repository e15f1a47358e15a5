"""Resample a voxel field on a rotated grid: what planners trust is kept, pictures change a little.

Density. As when a field is baked (bake.py), raw densities are fitted so that the grid has the same optical depth
along rays: the density of the old field is averaged around each new node with the weights of its hat function, whose
variance is 1/6 of a squared voxel, by three points along each axis, at -1/sqrt(3), 0 and 1/sqrt(3) voxels. Colour.
The mean of the same points, each weighted by its density, so that the space before a surface does not stain it.
Evidence. A node is free where all around it was proven free; all others are solid or unproven (see
conservative_occupancy.py), as is what the new box holds that the old one did not. Noise. What pictures lose is
measured, and added to what filters take for the noise of the field.

Surroundings. Notation as in nerfnav/field/render/surroundings.py. A node of contracted space at u, r = max |u_i|,
stands for the points along its direction from r - 1/K to r + 1/K. Space in the old box there adds its optical depth,
rho |dp/dr| / K for a shell; space around it adds what the old shells stop there, once for each that is crossed.
Colours are the means, weighted likewise.
"""

import math
from collections.abc import Generator
from dataclasses import replace

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.core.jit import default_threads, threads
from nerfnav.field.core.info import FieldInfo
from nerfnav.field.core.occupancy import (
    DENSITY_SCALE,
    EMPTY_RAW,
    Occupancy,
    States,
    classify_nodes,
    inverse_softplus,
    raw_of,
)
from nerfnav.field.edit.bake import BakeConfig, EditStep, fitted, fitting_shape, sample_views
from nerfnav.field.edit.conservative_occupancy import between_grids, preserve_occupancy
from nerfnav.field.kernels.resample import measure_turned
from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.render.surroundings import RAW_TO_DEPTH, SPAN, Surroundings, uncontracted
from nerfnav.field.render.volume_rendering import render_image
from nerfnav.geometry import Box, Camera, Similarity, node_positions, psnr_db, trilinear

_AXIS = torch.tensor([-1.0, 0.0, 1.0]) / math.sqrt(3.0)
_WEIGHTS = torch.tensor([0.25, 0.5, 0.25])

Grid = Float[Tensor, "nx ny nz"]


@torch.no_grad()
def resample_field(field: VoxelField, similarity: Similarity) -> Generator[EditStep, None, VoxelField]:
    """Resample a field after p' = s R p + t, on nodes s times as far apart.

    Raises InvalidInputError where these are too many, or more than memory holds.
    """
    box, spacing = similarity.box(field.box), similarity.scale * float(field.spacing.min())
    back, shape = similarity.inverted(), fitting_shape(box, spacing, what="the turned field", advice="crop it first")
    yield EditStep("turning the field", 0.0)
    values = _measured(field, replace(field, box=box, values=torch.zeros(*shape, 4), evidence=None), back)
    empty = BakeConfig.empty_below / spacing
    values[..., 0] = fitted(values[..., 0].contiguous(), BakeConfig.sweeps, empty)
    evidence = _evidence(field, box, back, values[..., 0])
    turned = replace(field, box=box, values=_with_spread_colors(values), outside=None, evidence=evidence)
    yield EditStep("keeping what is solid", 0.7)
    turned = preserve_occupancy(turned, field, back)
    yield EditStep("turning the surroundings", 0.85)
    turned = replace(turned, outside=resample_surroundings(field, box, back))
    turned = replace(turned, info=_noted(field, turned, back))
    yield EditStep("turned", 1.0)
    return turned


def _measured(field: VoxelField, empty: VoxelField, back: Similarity) -> Float[Tensor, "nx ny nz 4"]:
    """Densities [1/m] and colours of the nodes of a new grid, those of `empty`."""
    values, occupied, *_ = field.kernel_grid
    weights = (_WEIGHTS[:, None, None] * _WEIGHTS[:, None] * _WEIGHTS).reshape(-1)
    offsets = torch.cartesian_prod(_AXIS, _AXIS, _AXIS)
    measured = np.zeros((*empty.shape, 4), np.float32)
    with threads(default_threads()):
        measure_turned(
            values, occupied, np.float32(back.scale * DENSITY_SCALE), *between_grids(empty, field, back),
            offsets.double().numpy(), weights.numpy(), measured,
        )  # fmt: skip
    return torch.from_numpy(measured)


def _at_nearest(grid: Tensor, field: VoxelField, points: Float[Tensor, "*batch 3"]) -> Tensor:
    """Values of a grid at the nodes nearest to points [m]."""
    index = ((points - field.box.lower) / field.spacing).round().long()
    return grid[tuple(torch.minimum(index.clamp_min(0), torch.tensor(field.shape) - 1).unbind(-1))]


def _with_spread_colors(values: Float[Tensor, "nx ny nz 4"]) -> Float[Tensor, "nx ny nz 4"]:
    """Nodes, the empty ones coloured as those beside them: colours are interpolated to where there is density."""
    colors, known = values[..., 1:], (values[..., :1] > EMPTY_RAW + 1).float()
    weight = _around(known)
    spread = _around(known * colors) / weight.clamp_min(1e-9)
    return torch.cat([values[..., :1], torch.where(known > 0, colors, spread)], -1)


def _around(values: Float[Tensor, "nx ny nz c"]) -> Float[Tensor, "nx ny nz c"]:
    """Means over the nodes beside each."""
    return torch.nn.functional.avg_pool3d(values.permute(3, 0, 1, 2)[None], 3, 1, 1)[0].permute(1, 2, 3, 0)


def _evidence(field: VoxelField, box: Box, back: Similarity, raw: Grid) -> States | None:
    """The states of new nodes: free are those that lay in free space, nearest to a node that was proven free."""
    if field.evidence is None:
        return None
    proven, slack = field.evidence == Occupancy.FREE, 1e-3 * field.spacing
    wide = Box(field.box.lower - slack, field.box.upper + slack)
    limit = raw_of(field.solid_density)
    planes = []
    for plane in node_positions(box, (raw.shape[0], raw.shape[1], raw.shape[2])):
        points = back(plane)
        clear = trilinear(field.planned.values[..., :1], field.box, points)[..., 0] <= limit
        planes.append(clear & wide.contains(points) & _at_nearest(proven, field, points))
    return classify_nodes(torch.stack(planes), raw)


def _noted(field: VoxelField, turned: VoxelField, back: Similarity) -> FieldInfo:
    """Add the noise that resampling has caused, measured on views from all around, to the field's info."""
    config = BakeConfig()
    camera = Camera.from_fov(config.size, config.size, config.fov_deg)
    poses = sample_views(turned.box, config.views, config.distance)
    errors = torch.stack([
        render_image(turned, camera, poses[index]).color - render_image(field, camera, back.pose(poses[index])).color
        for index in range(config.views)
    ])  # fmt: skip
    lost, info = float(errors.square().mean()), field.info
    noise = None if info.noise_std is None else math.hypot(info.noise_std, math.sqrt(lost))
    return replace(info, noise_std=noise, baked_psnr_db=psnr_db(lost))


_SAMPLES = 6
"""Points along the radius that each node stands for."""
_FARTHEST = 0.25
"""Margin that sample points keep from infinity [shells]."""
_AHEAD = 0.01
"""Step of finite differences along the radius [shells]."""
_AT_ONCE = 1 << 16

Points = Float[Tensor, "n 3"]


@torch.no_grad()
def resample_surroundings(field: VoxelField, box: Box, back: Similarity) -> Surroundings | None:
    """Resample what `field` and its surroundings hold around `box`; `back` maps points [m] to the field's frame.

    None for a field without surroundings.
    """
    if field.outside is None:
        return None
    nodes = field.outside.values.shape[0]
    contracted = node_positions(SPAN, (nodes, nodes, nodes)).reshape(-1, 3)
    parts = [_at(field, field.outside, box, back, part) for part in contracted.split(_AT_ONCE)]
    return Surroundings(torch.cat(parts).reshape(nodes, nodes, nodes, 4))


def _at(field: VoxelField, outside: Surroundings, box: Box, back: Similarity, nodes: Points) -> Float[Tensor, "n 4"]:
    """Raw densities and colours at contracted points of the new surroundings."""
    count = outside.shells
    nodes = nodes.double()  # differences along the radius are small
    radius = nodes.abs().amax(-1, keepdim=True)
    direction = nodes / radius.clamp_min(1e-6)
    depths, colors = [], []
    for sample in range(_SAMPLES):
        offset = (2 * (sample + 0.5) / _SAMPLES - 1) / count
        at = (radius + offset).clamp(1, 2 - _FARTHEST / count)
        points = back(uncontracted(box, at * direction))
        ahead = back(uncontracted(box, (at + _AHEAD / count) * direction))
        depth, color = _stopped(field, outside, points, ahead)
        depths.append(depth)
        colors.append(depth[:, None] * color + 1e-6 * color)
    depth = torch.stack(depths).mean(0)
    color = torch.stack(colors).sum(0) / (_SAMPLES * depth + _SAMPLES * 1e-6)[:, None]
    raw = inverse_softplus((depth / RAW_TO_DEPTH).double().clamp_min(1e-9)).float().clamp_min(EMPTY_RAW)
    return torch.cat([raw[:, None], color], -1)


def _stopped(
    field: VoxelField, outside: Surroundings, points: Points, ahead: Points
) -> tuple[Float[Tensor, " n"], Points]:
    """Optical depth of a shell of the new surroundings at points [m] of the field, and its colour.

    `ahead` are the points a little further along the radius.
    """
    inside = field.box.contains(points)
    within = trilinear(field.values, field.box, points.float())
    length = (ahead - points).norm(dim=-1).float() / _AHEAD
    dense = DENSITY_SCALE * torch.nn.functional.softplus(within[:, 0]) * length
    here, there = (_contracted(field.box, at) for at in (points, ahead))
    around = trilinear(outside.values, SPAN, here.float())
    # as many of the old shells as are crossed along a new one
    crossed = outside.shells * (there.abs().amax(-1) - here.abs().amax(-1)).abs().float() / _AHEAD
    depth = torch.where(inside, dense, RAW_TO_DEPTH * torch.nn.functional.softplus(around[:, 0]) * crossed)
    return depth, torch.where(inside[:, None], within[:, 1:], around[:, 1:])


def _contracted(box: Box, points: Points) -> Points:
    """u of world points [m]."""
    at = (points - box.center) / (0.5 * box.size)
    size = at.abs().amax(-1, keepdim=True).clamp_min(1e-9)
    return torch.where(size > 1, (2 - 1 / size) * at / size, at)
