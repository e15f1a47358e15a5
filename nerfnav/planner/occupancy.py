"""Where a body fits: the density pooled over the body's size, on a grid coarse enough to search.

A voxel is occupied where the densest point of a body placed at its centre exceeds a threshold. The map belongs to a
field and a body: make it once and plan on it many times.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
from jaxtyping import Bool, Float
from scipy import ndimage
from torch import Tensor

from nerfnav.field.field import Field
from nerfnav.geometry.box import Box
from nerfnav.geometry.grid import node_positions, shape_for, spacing_of
from nerfnav.robots.body import Body
from nerfnav.robots.state import RigidState

_POINTS_AT_ONCE = 1 << 17


@dataclass(frozen=True)
class OccupancyConfig:
    """How a field becomes a map."""

    threshold: float = 5.0
    """Density above which a place counts as occupied [1/m]: a body of 10 cm in there would be hit with a chance of
    40 %. Stones have 50 and more, fog less than 1."""
    voxel: float = 0.04
    """Edge of a voxel [m]: about half a body."""
    samples_per_voxel: int = 2
    """Densities taken along each edge of a voxel."""
    clearance: float = 0.1
    """Distance to occupied space [m] beyond which a path has no reason to keep off further."""
    clearance_weight: float = 1.0
    """How much dearer than open space a metre along a wall is."""


@dataclass(frozen=True)
class OccupancyMap:
    """Which voxels a body can stand in, whatever its heading."""

    box: Box
    """Where the field is defined; voxel centres stand on its borders too."""
    occupied: Bool[Tensor, "nx ny nz"]
    """Whether a body at the voxel's centre would be in dense space."""
    config: OccupancyConfig
    """What it was made with."""

    @classmethod
    def of(cls, field: Field, body: Body, config: OccupancyConfig | None = None) -> "OccupancyMap":
        """Ask `field` for its density on a grid and pool it over the size of `body`."""
        config = OccupancyConfig() if config is None else config
        parts = config.samples_per_voxel
        box = field.box.to("cpu")
        nx, ny, nz = ((count - 1) * parts + 1 for count in shape_for(box, config.voxel))
        density = _density_on_grid(field, (nx, ny, nz))
        spacing = spacing_of(box, (nx, ny, nz))
        across = 0.5 * max(body.extents[:2])  # any heading, and what is cut off at the corners costs clearance
        for axis, half in enumerate((across, across, 0.5 * body.extents[2])):
            density = _pool(density, axis, int(np.ceil(half / spacing[axis].item() - 1e-6)))
        return cls(box, density[::parts, ::parts, ::parts] > config.threshold, config)

    @property
    def spacing(self) -> Float[Tensor, "3"]:
        """Distance of voxel centres along x, y, z [m]."""
        nx, ny, nz = self.occupied.shape
        return spacing_of(self.box, (nx, ny, nz))

    @cached_property
    def prices(self) -> np.ndarray:
        """What a metre costs in each voxel, at least 1: more near occupied space, infinite inside."""
        free = ~self.occupied.numpy()
        if free.all():  # no distance to speak of
            return np.ones(free.shape, np.float32)
        distance = np.asarray(ndimage.distance_transform_edt(free, sampling=self.spacing.tolist()))
        near = np.clip(1 - distance / self.config.clearance, 0, None)
        return np.where(free, 1 + self.config.clearance_weight * near**2, np.inf).astype(np.float32)

    def nearest_free_voxels(self, point: Float[Tensor, "3"], reach: float) -> Float[Tensor, "n 3"]:
        """Centres of free voxels within `reach` [m] of `point`, the nearest first."""
        lower = ((point - reach - self.box.lower) / self.spacing).ceil().long().clamp_min(0)
        upper = ((point + reach - self.box.lower) / self.spacing).floor().long() + 1
        window = tuple(slice(int(low), max(int(low), int(high))) for low, high in zip(lower, upper, strict=True))
        index = (~self.occupied[window]).nonzero() + lower
        centers = self.centers(index)
        distance = (centers - point).norm(dim=-1)
        order = distance.argsort(stable=True)
        return centers[order[distance[order] <= reach]]

    def centers(self, index: Tensor) -> Float[Tensor, "n 3"]:
        """World positions [m] of voxels, given as integer (i, j, k)."""
        return self.box.lower + index * self.spacing

    def index(self, point: Float[Tensor, "3"]) -> np.ndarray:
        """The voxel (i, j, k) whose centre is nearest to a point in the box [m]."""
        return ((point - self.box.lower) / self.spacing).round().long().numpy()


def body_density(field: Field, body: Body, state: RigidState) -> float:
    """The largest density at any point of the body [1/m]."""
    with torch.no_grad():
        points = body.points_body.to(state.position) @ state.rotation.T + state.position
        return field.density(points).max().item()


@torch.no_grad()
def _density_on_grid(field: Field, shape: tuple[int, int, int]) -> Tensor:
    lower = field.box.lower
    points = node_positions(field.box.to("cpu"), shape).reshape(-1, 3)
    return torch.cat([field.density(part.to(lower)).cpu() for part in points.split(_POINTS_AT_ONCE)]).reshape(shape)


def _pool(values: Tensor, axis: int, reach: int) -> Tensor:
    """The largest value within `reach` nodes along an axis."""
    if reach == 0:
        return values
    moved = values.movedim(axis, -1)
    rows = moved.reshape(1, -1, moved.shape[-1])
    pooled = torch.nn.functional.max_pool1d(rows, 2 * reach + 1, stride=1, padding=reach)
    return pooled.reshape(moved.shape).movedim(-1, axis)
