"""Resample the surroundings of a field around another box: that of a rotated field, or of a cropped one.

Notation as in nerfnav/field/render/surroundings.py. A node of contracted space at u, r = max |u_i|, stands for the
points along its direction from r - 1/K to r + 1/K. Space in the old box there adds its optical depth, rho |dp/dr| / K
for a shell; space around it adds what the old shells stop there, once for each that is crossed. Colours are the
means, weighted likewise.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.field.core.occupancy import DENSITY_SCALE, EMPTY_RAW
from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.render.surroundings import RAW_TO_DEPTH, SPAN, Surroundings, uncontracted
from nerfnav.geometry import Box, Similarity, node_positions, trilinear

_SAMPLES = 6
"""Points along the radius that each node stands for."""
_FARTHEST = 0.25
"""How near to infinity points are taken [shells]."""
_AHEAD = 0.01
"""How far along the radius derivatives look [shells]."""
_AT_ONCE = 1 << 16

Points = Float[Tensor, "n 3"]


@torch.no_grad()
def resample_surroundings(field: VoxelField, box: Box, back: Similarity) -> Surroundings | None:
    """What stands around `box`, as far as `field` and its surroundings know it; `back` takes points [m] to the field's.

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
    share = (depth / RAW_TO_DEPTH).double().clamp_min(1e-9)
    raw = (share + torch.log(-torch.expm1(-share))).float().clamp_min(EMPTY_RAW)
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
