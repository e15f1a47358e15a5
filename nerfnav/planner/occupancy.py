"""Where a body fits: the density pooled over the body's size, on a grid coarse enough to search.

A voxel is occupied where the densest point of a body placed at its centre exceeds a threshold. The map belongs to a
field and a body: make it once and plan on it many times. A body that is longer than wide has one map for each heading,
since it may fit through a gap that it must turn for.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from nerfnav.field.evidence import SOLID_DENSITY
from nerfnav.field.field import Field
from nerfnav.geometry.box import Box
from nerfnav.geometry.grid import node_positions, shape_for, spacing_of
from nerfnav.robots.body import Body
from nerfnav.robots.state import RigidState

_POINTS_AT_ONCE = 1 << 17


@dataclass(frozen=True)
class OccupancyConfig:
    """How a field becomes a map."""

    threshold: float = SOLID_DENSITY
    """Density above which a place counts as occupied [1/m]."""
    voxel: float = 0.04
    """Edge of a voxel [m]: about half a body."""
    samples_per_voxel: int = 2
    """Densities taken along each edge of a voxel."""
    clearance: float = 0.1
    """Distance to occupied space [m] beyond which a path has no reason to keep off further."""
    clearance_weight: float = 1.0
    """How much dearer than open space a metre along a wall is."""
    slender: float = 1.5
    """A body whose length and width differ by more than this factor gets a map for each heading."""
    headings: int = 8
    """Headings over half a turn for such a body; a box turned by half a turn covers the same."""


@dataclass(frozen=True)
class OccupancyMap:
    """Which voxels a body can stand in."""

    box: Box
    """Where the field is defined; voxel centres stand on its borders too. Flat for a map of one height."""
    by_heading: Bool[Tensor, "m nx ny nz"]
    """Whether a body at the voxel's centre, heading i pi / m, would be in dense space; m = 1: whatever its heading."""
    config: OccupancyConfig
    """What it was made with."""

    @classmethod
    def of(
        cls, field: Field, body: Body, config: OccupancyConfig | None = None, height: float | None = None
    ) -> "OccupancyMap":
        """Ask `field` for its density on a grid and pool it over the size of `body`.

        With a `height` [m], the map has only the voxels at that height, for a body that never leaves it.
        """
        config = OccupancyConfig() if config is None else config
        if height is None:
            box, dense = field.box.to("cpu"), _dense_columns(field, body, config)
        else:
            box = _flat(field.box.to("cpu"), height)
            dense = _dense_layer(field, body, config, height)
        nx, ny, _ = dense.shape
        spacing = spacing_of(box, (nx, ny, 2))
        return cls(box, _by_heading(dense, spacing, body, config), config)

    @cached_property
    def occupied(self) -> Bool[Tensor, "nx ny nz"]:
        """Whether the body would be in dense space at the voxel's centre with any heading."""
        return self.by_heading.all(0)

    @cached_property
    def spacing(self) -> Float[Tensor, "3"]:
        """Distance of voxel centres along x, y, z [m]."""
        counts = torch.tensor(self.by_heading.shape[1:]) - 1
        return torch.where(counts > 0, self.box.size / counts.clamp_min(1), self.config.voxel)

    @cached_property
    def prices(self) -> np.ndarray:
        """What a metre costs in each voxel, (m, nx, ny, nz) float64 >= 1: more near walls, infinite inside."""
        spacing = self.spacing.tolist()
        return np.stack([self._prices(~occupied.numpy(), spacing) for occupied in self.by_heading])

    def _prices(self, free: np.ndarray, spacing: list[float]) -> np.ndarray:
        if free.all():  # no distance to speak of
            return np.ones(free.shape)
        distance = np.asarray(scipy.ndimage.distance_transform_edt(free, sampling=spacing))
        near = np.clip(1 - distance / self.config.clearance, 0, None)
        return np.where(free, 1 + self.config.clearance_weight * near**2, np.inf)

    def nearest_free_voxels(
        self, point: Float[Tensor, "3"], reach: float, heading: int | None = None
    ) -> Float[Tensor, "n 3"]:
        """Centres of voxels within `reach` [m] of `point` that are free with that, or any, heading, the nearest first.
        """
        occupied = self.occupied if heading is None else self.by_heading[heading]
        lower = ((point - reach - self.box.lower) / self.spacing).ceil().long().clamp_min(0)
        upper = ((point + reach - self.box.lower) / self.spacing).floor().long() + 1
        window = tuple(slice(int(low), max(int(low), int(high))) for low, high in zip(lower, upper, strict=True))
        index = (~occupied[window]).nonzero() + lower
        centers = self.centers(index)
        distance = (centers - point).norm(dim=-1)
        order = distance.argsort(stable=True)
        return centers[order[distance[order] <= reach]]

    def centers(self, index: Tensor) -> Float[Tensor, "n 3"]:
        """World positions [m] of voxels, given as integer (i, j, k)."""
        return self.box.lower + index * self.spacing

    def index(self, point: Float[Tensor, "3"]) -> np.ndarray:
        """The voxel (i, j, k) whose centre is nearest to a point in the box [m]."""
        index = ((point - self.box.lower) / self.spacing).round().long()
        return torch.minimum(index.clamp_min(0), torch.tensor(self.by_heading.shape[1:]) - 1).numpy()


def body_density(field: Field, body: Body, state: RigidState) -> float:
    """The largest density at any point of the body [1/m]."""
    with torch.no_grad():
        points = body.points_body.to(state.position) @ state.rotation.T + state.position
        return field.density(points).max().item()


def _by_heading(dense: Tensor, spacing: Tensor, body: Body, config: OccupancyConfig) -> Tensor:
    """Columns (fine nx, fine ny, nz) that hold something dense, pooled over the body's outline, (m, nx, ny, nz)."""
    parts, (length, width, _) = config.samples_per_voxel, body.extents
    if max(length, width) <= config.slender * min(length, width):
        across = 0.5 * max(length, width)  # any heading, and what is cut off at the corners costs clearance
        for axis in (0, 1):
            dense = _pool(dense, axis, math.ceil(across / spacing[axis].item() - 1e-6))
        return dense[None, ::parts, ::parts]
    headings = torch.arange(config.headings) * (torch.pi / config.headings)
    return torch.stack([_under(dense, spacing, (length, width), heading, parts) for heading in headings.tolist()])


def _under(
    dense: Tensor, spacing: Tensor, outline: tuple[float, float], heading: float, parts: int
) -> Bool[Tensor, "nx ny nz"]:
    """Whether a rectangle (length, width) [m] with a heading [rad], at every `parts`-th column, holds a dense one."""
    reach = [math.ceil(0.5 * math.hypot(*outline) / step) for step in spacing[:2].tolist()]
    padded = torch.nn.functional.pad(dense, (0, 0, reach[1], reach[1], reach[0], reach[0]))
    offsets = torch.cartesian_prod(*(torch.arange(-far, far + 1) for far in reach))
    x, y = (offsets * spacing[:2]).unbind(-1)
    along, across = x * math.cos(heading) + y * math.sin(heading), y * math.cos(heading) - x * math.sin(heading)
    slack = 0.5 * spacing[:2].max()  # a column stands for what is half a column around it
    inside = (along.abs() <= 0.5 * outline[0] + slack) & (across.abs() <= 0.5 * outline[1] + slack)
    nx, ny, _ = dense.shape
    found = torch.zeros_like(dense[::parts, ::parts])
    for i, j in (offsets[inside] + torch.tensor(reach)).tolist():
        found |= padded[i : i + nx : parts, j : j + ny : parts]
    return found


def _dense_columns(field: Field, body: Body, config: OccupancyConfig) -> Bool[Tensor, "fx fy nz"]:
    """Whether anything over the body's height around a voxel's is dense; x and y as fine as densities are taken."""
    parts, box = config.samples_per_voxel, field.box.to("cpu")
    nx, ny, nz = ((count - 1) * parts + 1 for count in shape_for(box, config.voxel))
    density = _density_at(field, node_positions(box, (nx, ny, nz)))
    step = spacing_of(box, (nx, ny, nz))[2].item()
    pooled = _pool(density, 2, math.ceil(0.5 * body.extents[2] / step - 1e-6))
    return pooled[..., ::parts] > config.threshold


def _dense_layer(field: Field, body: Body, config: OccupancyConfig, height: float) -> Bool[Tensor, "fx fy 1"]:
    """The same for one height [m], exactly over the height of the body's points."""
    parts, box = config.samples_per_voxel, field.box.to("cpu")
    nx, ny, _ = ((count - 1) * parts + 1 for count in shape_for(box, config.voxel))
    levels = height + body.points_body[:, 2].unique()
    flat = node_positions(_flat(box, 0.0), (nx, ny, 1)).expand(nx, ny, len(levels), 3).clone()
    flat[..., 2] = levels
    return (_density_at(field, flat) > config.threshold).any(-1, keepdim=True)


def _flat(box: Box, height: float) -> Box:
    lower, upper = box.lower.clone(), box.upper.clone()
    lower[2] = upper[2] = height
    return Box(lower, upper)


@torch.no_grad()
def _density_at(field: Field, points: Float[Tensor, "nx ny nz 3"]) -> Float[Tensor, "nx ny nz"]:
    like = field.box.lower
    parts = points.reshape(-1, 3).split(_POINTS_AT_ONCE)
    return torch.cat([field.density(part.to(like)).cpu() for part in parts]).reshape(points.shape[:-1])


def _pool(values: Tensor, axis: int, reach: int) -> Tensor:
    """The largest value within `reach` nodes along an axis."""
    if reach == 0:
        return values
    moved = values.movedim(axis, -1)
    rows = moved.reshape(1, -1, moved.shape[-1]).float()
    pooled = torch.nn.functional.max_pool1d(rows, 2 * reach + 1, stride=1, padding=reach)
    return pooled.reshape(moved.shape).movedim(-1, axis).to(values)
