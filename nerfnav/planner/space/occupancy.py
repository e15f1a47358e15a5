"""Where a field is dense, over the height of a body: what maps are pooled from (see occupancy.py)."""

import math

import numpy as np
import torch
from jaxtyping import Bool, Float, UInt8
from torch import Tensor

from nerfnav.core.jit import default_threads, threads
from nerfnav.field import Field, GridField
from nerfnav.field.core.occupancy import raw_of
from nerfnav.geometry import Box, node_positions, shape_for, spacing_of
from nerfnav.planner.kernels import maps
from nerfnav.planner.space.scales import Scales
from nerfnav.robots import Body

_POINTS_AT_ONCE = 1 << 17
_RIM = 1e-6
"""Share of the box by which points on its border are moved inwards."""


def marked_columns(field: GridField, body: Body, scales: Scales, parts: int) -> UInt8[np.ndarray, "fx fy nz"]:
    """Whether a cell of the grid is dense anywhere over the body's height around a voxel's, within half a column."""
    box = field.box.to("cpu")
    nx, ny, nz = shape_for(box, scales.voxel)
    columns = np.zeros(((nx - 1) * parts + 1, (ny - 1) * parts + 1, nz), np.uint8)
    values, occupied, lower, _ = field.kernel_grid
    half_height = 0.5 * body.extents[2] / spacing_of(box, (nx, ny, nz))[2].item()
    with threads(default_threads()):
        maps.mark_columns(values, occupied, lower, raw_of(scales.threshold), half_height, columns)
    return columns


def sampled_columns(field: Field, body: Body, scales: Scales, parts: int) -> UInt8[np.ndarray, "fx fy nz"]:
    """Whether a sample over the body's height around a voxel's is dense; x and y as fine as samples are taken."""
    box = field.box.to("cpu")
    fx, fy, fz = ((count - 1) * parts + 1 for count in shape_for(box, scales.voxel))
    dense = dense_at(field, node_positions(box, (fx, fy, fz)), scales.threshold)
    step = spacing_of(box, (fx, fy, fz))[2].item()
    above = pooled(dense, math.ceil(0.5 * body.extents[2] / step - 1e-6))
    return np.ascontiguousarray(above[..., ::parts].numpy())


def layer_columns(field: Field, body: Body, scales: Scales, parts: int, height: float) -> UInt8[np.ndarray, "fx fy 1"]:
    """Whether a column is dense at one height [m], exactly over the height of the body's points."""
    box = field.box.to("cpu")
    nx, ny, _ = ((count - 1) * parts + 1 for count in shape_for(box, scales.voxel))
    levels = levels_of(body, height)
    flat = node_positions(flat_box(box, 0.0), (nx, ny, 1)).expand(nx, ny, len(levels), 3).clone()
    flat[..., 2] = levels
    return dense_at(field, flat, scales.threshold).amax(-1, keepdim=True).numpy()


def levels_of(body: Body, height: float) -> Float[Tensor, " levels"]:
    """The heights of a body's points [m], of one whose middle is at `height` [m]."""
    return height + body.points_body[:, 2].unique()


def covered(
    columns: UInt8[np.ndarray, "fx fy nz"],
    parts: int,
    outlines: Float[np.ndarray, "m 3"],
    spacing: Float[np.ndarray, "2"],
) -> Bool[np.ndarray, "m nx ny nz"]:
    """Where a body at every `parts`-th column covers one that is dense, with each of its outlines; see the kernel
    `mark_bodies`."""
    nx, ny = ((count - 1) // parts + 1 for count in columns.shape[:2])
    marked = np.zeros((len(outlines), nx, ny, columns.shape[2]), np.uint8)
    with threads(default_threads()):
        maps.mark_bodies(columns, parts, outlines, spacing, marked)
    return marked.view(bool)


def flat_box(box: Box, height: float) -> Box:
    """The layer of a box at one height [m]."""
    lower, upper = box.lower.clone(), box.upper.clone()
    lower[2] = upper[2] = height
    return Box(lower, upper)


@torch.no_grad()
def dense_at(
    field: Field, points: Float[Tensor, "*shape 3"], threshold: float
) -> UInt8[Tensor, "*shape"]:
    """Whether the density at each point is above a threshold [1/m]."""
    like, parts = field.box.lower, points.reshape(-1, 3).split(_POINTS_AT_ONCE)
    if isinstance(field, GridField):
        # the border belongs to the box, whatever rounding makes of it
        box, rim = field.box.to("cpu"), _RIM * field.box.to("cpu").size.double()
        inside = [part.double().clamp(box.lower + rim, box.upper - rim) for part in parts]
        found = [torch.from_numpy(field.density_and_gradient(part.numpy())[0]) for part in inside]
    else:
        found = [field.density(part.to(like)).cpu() for part in parts]
    dense = torch.cat(found) > threshold
    return dense.reshape(points.shape[:-1]).to(torch.uint8)


def pooled(dense: UInt8[Tensor, "nx ny nz"], reach: int) -> UInt8[Tensor, "nx ny nz"]:
    """Whether anything within `reach` nodes along z is dense."""
    if reach == 0:
        return dense
    rows = dense.reshape(1, -1, dense.shape[-1]).float()
    above = torch.nn.functional.max_pool1d(rows, 2 * reach + 1, stride=1, padding=reach)
    return above.reshape(dense.shape).to(torch.uint8)
