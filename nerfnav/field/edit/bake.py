"""Field baking: convert any field to a voxel field, and measure how alike the two look (PSNR).

Density. What matters is the optical depth that rays meet, the integral of rho, and a grid that interpolates raw
densities does not have the integral of what stands at its nodes. So it is fitted: with hat functions h_i, one for
each node, the moments T_i = integral h_i rho are taken of the field, at two points along each edge of a cell, and C_i
of the grid at the same points, and raw densities move by log(T_i / C_i) until they agree (for raw << 0, where
softplus(raw) = exp(raw), this is the update of Richardson and Lucy, 1972-74, which keeps sums).

Colour. A voxel has one colour from everywhere: the mean over directions, each weighted by the light that leaves the
node towards it.
"""

from collections.abc import Generator
from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.core.jit import default_threads, threads
from nerfnav.core.memory import require_memory
from nerfnav.field.core.info import FieldInfo
from nerfnav.field.core.occupancy import DENSITY_SCALE, EMPTY_RAW
from nerfnav.field.core.protocol import Field
from nerfnav.field.kernels.resample import add_moments
from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.render.volume_rendering import render_image
from nerfnav.geometry import (
    Box,
    Camera,
    Pose,
    dilate_nodes,
    fibonacci_directions,
    look_at,
    node_positions,
    psnr_db,
    shape_for,
    spacing_of,
)


def sample_views(box: Box, views: int, distance: float) -> Pose:
    """Poses T_world_camera (views) spread around and above the box, looking at its middle.

    `distance` is that from the middle, in diagonals of the box.
    """
    towards = fibonacci_directions((torch.arange(views) + 0.5) / views)
    return look_at(box.center + distance * box.size.norm() * towards, box.center.expand_as(towards))


def likeness(first: Field, second: Field, poses: Pose, camera: Camera) -> float:
    """Peak signal-to-noise ratio [dB] between what two fields show, over all pixels of all poses."""
    errors = [
        (render_image(first, camera, poses[index]).color.cpu() - render_image(second, camera, poses[index]).color)
        for index in range(len(poses.position))
    ]
    return psnr_db(torch.stack(errors).square().mean().item())


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


MOST_NODES = 30_000_000
"""Fitting takes eight points for each node."""
_BYTES = 70
"""Memory that fitting takes for each node [bytes]: 54 to 69 were measured."""
_AT_ONCE = 1 << 16
_NODES_ALONG = 160
_LEAST_LIGHT = 0.1  # share of a node's light: what less of it reaches hardly sees the node


@dataclass(frozen=True)
class BakeConfig:
    """Settings of baking a field."""

    voxel: float | None = None
    """Distance of nodes [m]; None: a 160th of the longest edge of the box."""
    directions: int = 14
    """Number of directions from which colours are taken."""
    sweeps: int = 12
    """Number of corrections of the raw densities."""
    opaque: float = 8.0
    """Optical depth of a voxel beyond which nothing is seen to change; densities are cut there."""
    empty_below: float = 0.002
    """Optical depth of a voxel under which it is empty."""
    views: int = 8
    """Number of views from around the box in which the two fields are compared."""
    size: int = 96
    """Width and height of those [pixels]."""
    fov_deg: float = 50.0
    """Their field of view."""
    distance: float = 1.2
    """Distance of their cameras from the box's middle, in diagonals of the box."""


@dataclass(frozen=True)
class EditStep:
    """Progress of editing a field: of baking or moving it."""

    label: str
    """Current phase, for the user."""
    fraction: float
    """Share of the work that is done, 0 to 1."""


def bake(field: Field, config: BakeConfig | None = None) -> Generator[EditStep, None, VoxelField]:
    """Bake `field` on a grid of its box, on its box's device and then the CPU; its info notes the PSNR of the result.

    Raises InvalidInputError where the voxels make no sense, or memory cannot hold them.
    """
    config = BakeConfig() if config is None else config
    box = field.box.to("cpu")
    voxel = float(box.size.max()) / _NODES_ALONG if config.voxel is None else config.voxel
    shape = fitting_shape(box, voxel)
    yield EditStep("looking for what is solid", 0.0)
    cells = _solid_cells(field, box, shape, config.empty_below / voxel)
    points = torch.zeros([2 * count for count in cells.shape])
    for share in _measure(field, box, cells, config.opaque / voxel, points):
        yield EditStep("measuring densities", 0.1 + 0.4 * share)
    raw = fitted(moments(points), config.sweeps, config.empty_below / voxel)
    yield EditStep("measuring colours", 0.55)
    values = torch.cat([raw[..., None], torch.full((*shape, 3), 0.5)], -1)
    baked = VoxelField(box, values, field.background.cpu(), getattr(field, "info", FieldInfo()))
    for share in _color(field, baked, config.directions):
        yield EditStep("measuring colours", 0.55 + 0.35 * share)
    poses = sample_views(box, config.views, config.distance)
    psnr = likeness(field, baked, poses, Camera.from_fov(config.size, config.size, config.fov_deg))
    yield EditStep("baked", 1.0)
    return replace(baked, info=replace(baked.info, made_by="baked", baked_psnr_db=psnr))


def fitting_shape(
    box: Box,
    voxel: float,
    most: int = MOST_NODES,
    what: str = "the field",
    advice: str = "choose larger ones",
) -> tuple[int, int, int]:
    """Numbers of nodes along x, y, z of a grid with nodes `voxel` [m] apart, whose densities are to be fitted.

    Raises InvalidInputError, which says `what` asks for them and ends in `advice`, where these are more than `most`,
    or more than memory holds.
    """
    if not voxel > 0 or box.size.double().prod().item() / voxel**3 > most:
        raise InvalidInputError(
            f"{what}: voxels of {voxel:g} m in a box of {box.describe()} are impossible or more than {most}: {advice}"
        )
    nx, ny, nz = shape_for(box, voxel)
    require_memory(_BYTES * nx * ny * nz, f"{what}: fitting {nx} x {ny} x {nz} voxels", advice)
    return nx, ny, nz


def _solid_cells(
    field: Field, box: Box, shape: tuple[int, int, int], least: float
) -> Bool[Tensor, "nx1 ny1 nz1"]:
    """Cells with density in their middle or their neighbours': the others are skipped."""
    spacing = spacing_of(box, shape)
    inner = Box(box.lower + 0.5 * spacing, box.upper - 0.5 * spacing)
    nx, ny, nz = (count - 1 for count in shape)
    centers = node_positions(inner, (nx, ny, nz)).reshape(-1, 3)
    dense = torch.cat([_density(field, part) for part in centers.split(_AT_ONCE)]) > least
    return dilate_nodes(dense.reshape(nx, ny, nz))


def _measure(
    field: Field, box: Box, cells: Bool[Tensor, "nx1 ny1 nz1"], most: float, points: Refined
) -> Generator[float, None, None]:
    """Fill in densities, at most `most` [1/m], at the `points` of chosen cells; yields the share that is done."""
    nx, ny, nz = (count + 1 for count in cells.shape)
    spacing = spacing_of(box, (nx, ny, nz))
    quarter = torch.tensor([0.25, 0.75])
    offsets = torch.stack(torch.meshgrid(quarter, quarter, quarter, indexing="ij"), -1).reshape(8, 3)
    blocks = points.unflatten(2, (-1, 2)).unflatten(1, (-1, 2)).unflatten(0, (-1, 2)).permute(0, 2, 4, 1, 3, 5)
    chosen = cells.nonzero()
    parts = chosen.split(_AT_ONCE // 8)
    for index, part in enumerate(parts):
        at = box.lower + (part[:, None] + offsets) * spacing
        x, y, z = part.unbind(-1)
        blocks[x, y, z] = _density(field, at).clamp_max(most).reshape(-1, 2, 2, 2)
        if index % 16 == 15:
            yield (index + 1) / len(parts)


def _color(field: Field, baked: VoxelField, count: int) -> Generator[float, None, None]:
    """Set the colours of all nodes near density, in place; yields the share that is done."""
    shape = baked.shape
    near = dilate_nodes(baked.values[..., 0] > EMPTY_RAW)
    nodes = node_positions(baked.box, shape)[near]
    outward = fibonacci_directions(1 - (2 * torch.arange(count) + 1) / count)
    colors, parts = [], nodes.split(_AT_ONCE // count)
    for number, part in enumerate(parts):
        colors.append(_mean_color(field, baked, part, outward))
        if number % 16 == 15:
            yield (number + 1) / len(parts)
    if colors:
        baked.values[near] = torch.cat([baked.values[near][:, :1], torch.cat(colors)], -1)


@torch.no_grad()
def _mean_color(
    field: Field, baked: VoxelField, nodes: Float[Tensor, "n 3"], outward: Float[Tensor, "k 3"]
) -> Float[Tensor, "n 3"]:
    """Mean colour of nodes over viewing directions, weighted by the light that reaches each direction."""
    count = len(outward)
    points, towards = nodes.repeat_interleave(count, 0), outward.repeat(len(nodes), 1)
    # a voxel further on, or every node would be hidden by itself
    light = 1 - baked.render_rays(points + 1.5 * baked.resolution * towards, towards).opacity
    light = light.reshape(-1, count) + 1e-6
    best = torch.nn.functional.one_hot(light.argmax(1), count).bool()
    seen = ((light > _LEAST_LIGHT) | best).reshape(-1)  # hidden nodes take one colour
    weights = torch.where(seen, light.reshape(-1), torch.zeros_like(light.reshape(-1)))
    found = torch.zeros_like(points)
    device = field.box.lower.device
    found[seen] = field.radiance(points[seen].to(device), -towards[seen].to(device)).cpu()
    total = (weights[:, None] * found).reshape(-1, count, 3).sum(1)
    return total / weights.reshape(-1, count).sum(1, keepdim=True)


@torch.no_grad()
def _density(field: Field, points: Float[Tensor, "*batch 3"]) -> Float[Tensor, "*batch"]:
    return field.density(points.to(field.box.lower.device)).cpu()
