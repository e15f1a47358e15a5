"""Occupancy map: density pooled over the body's size, on a grid coarse enough to search.

A voxel is occupied where a body placed at its centre would hold something dense: the density exceeds a threshold. The
map belongs to a field and a body: make it once and plan on it many times. A body that is longer than wide has one map
for each heading, since it may fit through a gap that it must turn for.

Maps are pooled from columns: where the field is dense over the height of the body. Of a field on a grid all cells are
looked at (kernels/maps.py): pooling never makes free what is not. Fields of the paper's scale, where specks of a node
stand in all free space, and fields that are no grid, are sampled at points, as finely as the config says; maps of one
height at points a quarter of the nodes' distance apart. `OccupancyConfig.exact` changes that.
"""

import math
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from typing import TypeGuard

import numpy as np
import torch
from jaxtyping import Bool, Float, UInt8
from torch import Tensor

from nerfnav.core.jit import default_threads, threads
from nerfnav.core.memory import require_memory
from nerfnav.field import Field, GridField, density_in_box
from nerfnav.field.core.occupancy import raw_of
from nerfnav.geometry import Box, node_positions, shape_for, spacing_of
from nerfnav.planner.kernels import maps
from nerfnav.planner.space.border import bordered_density, mark_beyond
from nerfnav.planner.space.scales import PAPERS_GRAIN, Scales, scales_of
from nerfnav.robots import Body, RigidState

_POINTS_AT_ONCE = 1 << 17
_MOST_LEVELS = 64
"""Largest number of heights at which a layer is looked at."""


def marked_columns(field: GridField, body: Body, scales: Scales, parts: int) -> UInt8[np.ndarray, "fx fy nz"]:
    """Mark columns with a dense cell of the grid over the body's height around a voxel's, within half a column."""
    box = field.box.to("cpu")
    nx, ny, nz = shape_for(box, scales.voxel)
    columns = np.zeros(((nx - 1) * parts + 1, (ny - 1) * parts + 1, nz), np.uint8)
    values, occupied, lower, _ = field.kernel_grid
    half_height = 0.5 * body.extents[2] / spacing_of(box, (nx, ny, nz))[2].item()
    with threads(default_threads()):
        maps.mark_columns(values, occupied, lower, raw_of(scales.threshold), half_height, columns)
    return columns


def sampled_columns(field: Field, body: Body, scales: Scales, parts: int) -> UInt8[np.ndarray, "fx fy nz"]:
    """Mark columns with a dense sample over the body's height around a voxel's; x and y as fine as samples are
    taken."""
    box = field.box.to("cpu")
    fx, fy, fz = ((count - 1) * parts + 1 for count in shape_for(box, scales.voxel))
    dense = dense_at(field, node_positions(box, (fx, fy, fz)), scales.threshold)
    step = spacing_of(box, (fx, fy, fz))[2].item()
    above = pooled(dense, math.ceil(0.5 * body.extents[2] / step - 1e-6))
    return np.ascontiguousarray(above[..., ::parts].numpy())


def layer_columns(field: Field, body: Body, scales: Scales, parts: int, height: float) -> UInt8[np.ndarray, "fx fy 1"]:
    """Mark columns that are dense at one height [m], exactly over the height of the body's points."""
    box = field.box.to("cpu")
    nx, ny, _ = ((count - 1) * parts + 1 for count in shape_for(box, scales.voxel))
    levels = build_levels(body, height)
    flat = node_positions(flat_box(box, 0.0), (nx, ny, 1)).expand(nx, ny, len(levels), 3).clone()
    flat[..., 2] = levels
    return dense_at(field, flat, scales.threshold).amax(-1, keepdim=True).numpy()


def build_levels(body: Body, height: float) -> Float[Tensor, " levels"]:
    """Return the heights of a body's points [m], with its middle at `height` [m]; of a shape with very many, as many
    evenly over the same height as a search can ask about."""
    levels = body.points_body[:, 2].unique()
    if len(levels) > _MOST_LEVELS:
        levels = torch.linspace(levels[0].item(), levels[-1].item(), _MOST_LEVELS).to(levels)
    return height + levels


def covered(
    columns: UInt8[np.ndarray, "fx fy nz"],
    parts: int,
    outlines: Float[np.ndarray, "m 3"],
    spacing: Float[np.ndarray, "2"],
) -> Bool[np.ndarray, "m nx ny nz"]:
    """Mark places at every `parts`-th column where a body covers a dense one, with each of its outlines; see the kernel
    `mark_bodies`."""
    nx, ny = ((count - 1) // parts + 1 for count in columns.shape[:2])
    marked = np.zeros((len(outlines), nx, ny, columns.shape[2]), np.uint8)
    with threads(default_threads()):
        maps.mark_bodies(columns, parts, outlines, spacing, marked)
    return marked.view(bool)


def flat_box(box: Box, height: float) -> Box:
    """Cut the layer of a box at one height [m]."""
    lower, upper = box.lower.clone(), box.upper.clone()
    lower[2] = upper[2] = height
    return Box(lower, upper)


@torch.no_grad()
def dense_at(
    field: Field, points: Float[Tensor, "*shape 3"], threshold: float
) -> UInt8[Tensor, "*shape"]:
    """Mark points with a density above a threshold [1/m]."""
    parts = points.reshape(-1, 3).cpu().split(_POINTS_AT_ONCE)
    dense = np.concatenate([density_in_box(field, part.double().numpy()) > threshold for part in parts])
    return torch.from_numpy(dense.astype(np.uint8)).reshape(points.shape[:-1])


def pooled(dense: UInt8[Tensor, "nx ny nz"], reach: int) -> UInt8[Tensor, "nx ny nz"]:
    """Mark nodes with a dense one within `reach` nodes along z."""
    if reach == 0:
        return dense
    rows = dense.reshape(1, -1, dense.shape[-1]).float()
    above = torch.nn.functional.max_pool1d(rows, 2 * reach + 1, stride=1, padding=reach)
    return above.reshape(dense.shape).to(torch.uint8)


_BYTES, _BYTES_BY_HEADING = 4, 35
"""Largest memory of a voxel while a map is made and searched [bytes]: columns, and for each heading its two states, its
price twice, and the notes of a search."""


@dataclass(frozen=True)
class OccupancyConfig:
    """Settings of an occupancy map; None follows from the place and the body (see Scales)."""

    threshold: float | None = None
    """Density above which a place counts as occupied [1/m]."""
    voxel: float | None = None
    """Edge of a voxel [m]."""
    samples_per_voxel: int = 2
    """Columns along each horizontal edge of a voxel, and densities of a field that is no grid along each edge."""
    clearance: float | None = None
    """Distance to occupied space [m] beyond which a path has no reason to keep off further."""
    clearance_weight: float = 1.0
    """Extra cost of a metre along a wall, in metres of open space."""
    slender: float = 1.5
    """A body whose length and width differ by more than this factor gets a map for each heading."""
    headings: int | None = None
    """Headings over half a turn for such a body; a box turned by half a turn covers the same."""
    exact: bool | None = None
    """Count every dense cell of a grid, however small; None: where nodes are more than 17 mm apart."""

    def scales(self, field: Field, body: Body) -> Scales:
        """Compute the scales of a body in a field, with these settings."""
        return scales_of(field, body, self.voxel, self.threshold)


@dataclass(frozen=True)
class OccupancyMap:
    """Occupancy map: the voxels in which a body does not fit."""

    box: Box
    """Box of the field; voxel centres stand on its borders too. Flat for a map of one height."""
    by_heading: Bool[Tensor, "m nx ny nz"]
    """True if a body at the voxel's centre, heading i pi / m, would be in dense space or reach beyond the border of the
    field's box; m = 1: with any heading."""
    dense: Bool[Tensor, "m nx ny nz"]
    """The same of dense space alone, for prices and the collision map, for which space a little beyond the border is
    like space a little inside."""
    config: OccupancyConfig
    """Settings with which it was made."""
    scales: Scales
    """The lengths that it was made with, and that searches on it have."""
    found: dict[tuple[object, ...], list[np.ndarray]] | None = field(default=None, compare=False, repr=False)
    """Paths that were found on it last, by their query (see astar.py); None where every search is made anew."""

    @classmethod
    def of(
        cls, field: Field, body: Body, config: OccupancyConfig | None = None, height: float | None = None
    ) -> "OccupancyMap":
        """Pool the dense parts of `field` over the size of `body`.

        With a `height` [m], the map has only the voxels at that height, for a body that never leaves it. Raises
        InvalidInputError where the memory cannot hold the map, before it is made.
        """
        config = OccupancyConfig() if config is None else config
        scales, box = config.scales(field, body), field.box.to("cpu")
        shape = shape_for(box, scales.voxel)
        exact, headings = _is_exact(field, config), headings_of(config, scales)
        _require_room(box, shape if height is None else (*shape[:2], 1), scales, len(headings))
        parts = config.samples_per_voxel
        if height is None:
            columns = (
                marked_columns(field, body, scales, parts) if exact and isinstance(field, GridField)
                else sampled_columns(field, body, scales, parts)
            )  # fmt: skip
        else:
            parts = max(parts, math.ceil(4 * scales.voxel / field.resolution - 1e-6)) if exact else parts
            columns, box = layer_columns(field, body, scales, parts, height), flat_box(box, height)
        spacing = spacing_of(box, (*columns.shape[:2], 2))[:2].double().numpy()
        dense = covered(columns, parts, _outlines(body, headings, spacing, exact), spacing)
        marked = dense.copy()
        mark_beyond(marked, headings, body, field.box.to("cpu"), height)
        return cls(box, torch.from_numpy(marked), torch.from_numpy(dense), config, scales)

    def remembering(self) -> "OccupancyMap":
        """Return the same map, on which one path is not searched twice in a row: for plans that differ in duration
        alone."""
        assert len(self.prices), "made here, for both"
        other = copy(self)
        object.__setattr__(other, "found", {})
        return other

    def is_of(self, height: float) -> bool:
        """Return True if this is the map of one height [m], to rounding."""
        flat = self.by_heading.shape[-1] == 1
        return flat and abs(self.box.lower[2].item() - height) <= 1e-6 * (1 + abs(height))

    @cached_property
    def occupied(self) -> Bool[Tensor, "nx ny nz"]:
        """Mark voxels at whose centres the body does not fit with any heading."""
        return self.by_heading.all(0)

    @cached_property
    def spacing(self) -> Float[Tensor, "3"]:
        """Return the distance of voxel centres along x, y, z [m]."""
        counts = torch.tensor(self.by_heading.shape[1:]) - 1
        return torch.where(counts > 0, self.box.size / counts.clamp_min(1), self.scales.voxel)

    @cached_property
    def prices(self) -> np.ndarray:
        """Compute the cost of a metre in each voxel, (m, nx, ny, nz) float64 >= 1: more near walls, infinite without
        room for the body."""
        spacing, config = self.spacing.double().numpy(), self.config
        clearance = self.scales.clearance if config.clearance is None else config.clearance
        each = [
            maps.prices_near(dense.numpy().view(np.uint8), spacing, clearance, config.clearance_weight)
            for dense in self.dense
        ]
        for prices, occupied in zip(each, self.by_heading, strict=True):
            prices[occupied.numpy()] = np.inf
        return each[0][None] if len(each) == 1 else np.stack(each)

    def nearest_free_voxels(
        self, point: Float[Tensor, "3"], reach: float, heading: int | None = None
    ) -> Float[Tensor, "n 3"]:
        """List centres of voxels within `reach` [m] of `point` that are free with that, or any, heading, the nearest
        first.
        """
        occupied = self.occupied if heading is None else self.by_heading[heading]
        lower = ((point - reach - self.box.lower) / self.spacing).ceil().long().clamp_min(0)
        upper = ((point + reach - self.box.lower) / self.spacing).floor().long() + 1
        window = tuple(slice(int(low), max(int(low), int(high))) for low, high in zip(lower, upper, strict=True))
        centers = self.centers((~occupied[window]).nonzero() + lower)
        distance = (centers - point).norm(dim=-1)
        order = distance.argsort(stable=True)
        return centers[order[distance[order] <= reach]]

    def centers(self, index: Tensor) -> Float[Tensor, "n 3"]:
        """Convert voxels, given as integer (i, j, k), to world positions [m]."""
        return self.box.lower + index * self.spacing

    def index(self, point: Float[Tensor, "3"]) -> np.ndarray:
        """Find the voxel (i, j, k) whose centre is nearest to a point in the box [m]."""
        index = ((point - self.box.lower) / self.spacing).round().long()
        return torch.minimum(index.clamp_min(0), torch.tensor(self.by_heading.shape[1:]) - 1).numpy()


@torch.no_grad()
def body_density(field: Field, body: Body, state: RigidState) -> float:
    """Find the largest density at any point of the body [1/m]; what is beyond the field's box is as dense as solid
    space."""
    return bordered_density(field, body.points_at(state)).max().item()


def _is_exact(field: Field, config: OccupancyConfig) -> TypeGuard[GridField]:
    """Return True if all cells of a field are checked."""
    if not isinstance(field, GridField):
        return False
    return field.resolution > PAPERS_GRAIN if config.exact is None else config.exact


def headings_of(config: OccupancyConfig, scales: Scales) -> list[float]:
    """Return the headings for which maps are made [rad]; a single one where a body is about as long as wide."""
    if scales.length <= config.slender * scales.width:
        return [0.0]
    count = scales.headings if config.headings is None else config.headings
    return [heading * math.pi / count for heading in range(count)]


def _outlines(
    body: Body, headings: list[float], spacing: Float[np.ndarray, "2"], exact: bool
) -> Float[np.ndarray, "m 3"]:
    """Return half length and half width [m] over which columns count, and heading [rad], of the body in each of its
    maps.

A column `spacing` [m] from the next stands for what is half a column around it.
    """
    length, width, _ = body.extents
    if len(headings) == 1:  # any heading, and what is cut off at the corners costs clearance
        half = 0.5 * max(length, width)
        x, y = (half + 0.5 * step if exact else step * math.ceil(half / step - 1e-6) for step in spacing.tolist())
        return np.array([[x, y, 0.0]])
    rows = []
    for heading in headings:
        cosine, sine = abs(math.cos(heading)), abs(math.sin(heading))
        ahead, aside = spacing @ [cosine, sine], spacing @ [sine, cosine]
        slack = (ahead, aside) if exact else (spacing.max(), spacing.max())
        rows.append([0.5 * (length + slack[0]), 0.5 * (width + slack[1]), heading])
    return np.array(rows)


def _require_room(box: Box, shape: tuple[int, int, int], scales: Scales, headings: int) -> None:
    """Refuse a map that the memory cannot hold."""
    needed = math.prod(shape) * (_BYTES + _BYTES_BY_HEADING * headings)
    size = " x ".join(f"{edge:.3g}" for edge in box.size.tolist())
    require_memory(
        needed, f"a map of {size} m with voxels of {scales.voxel:.3g} m", "choose a larger voxel of the occupancy map"
    )
