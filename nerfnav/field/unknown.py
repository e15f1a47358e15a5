"""Space that no camera ever saw into: insides of walls, backs of furniture. A field says nothing about it.

A node is known when light that came by it reached a camera: rays of random pixels of the training images are followed
through the trained field, and a node counts as seen where enough samples of rays with enough light left are nearest
to it. What is behind a surface is not, however clear the field may be there.
"""

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
import torch
from jaxtyping import Bool
from torch import Tensor

from nerfnav.compiled import default_threads, threads
from nerfnav.field.composite import CompositeField
from nerfnav.field.field import Field
from nerfnav.field.kernels import sight
from nerfnav.field.rays import RaySampler
from nerfnav.field.voxel import DENSITY_SCALE, VoxelField
from nerfnav.geometry.images import PosedImages

_RAYS_AT_ONCE = 1 << 16


class Unknown(Enum):
    """What planners take unknown space for."""

    OCCUPIED = "occupied"
    """As solid: a hollow stone is no corridor."""
    FREE = "free"
    """As the field says."""


@dataclass(frozen=True)
class SightConfig:
    """When a node counts as seen."""

    rays_per_node: float = 0.25
    """Rays that are followed, for each node of the grid."""
    least_light: float = 0.5
    """Share of its light that a ray must have left."""
    least_samples: int = 1
    """Samples of rays, two in a voxel, that must come by."""
    least_neighbours: float = 0.3
    """Share of the 27 nodes around an unseen one that must be unseen too, or it was missed by chance."""


def planning_field(field: Field, unknown: Unknown) -> Field:
    """What to plan in: `field` with its unknown nodes solid, or as it is. Fields that know of none stay as they are;
    of a composite field this is said for each part."""
    if unknown is Unknown.OCCUPIED and isinstance(field, VoxelField):
        return field.solid_where_unknown
    if isinstance(field, CompositeField):
        return CompositeField(tuple(replace(part, field=planning_field(part.field, unknown)) for part in field.parts))
    return field


def with_unknown(
    field: VoxelField, photographs: PosedImages, generator: torch.Generator, config: SightConfig | None = None
) -> VoxelField:
    """The field with its unknown nodes marked: those that the cameras of `photographs` did not see into."""
    config = config or SightConfig()
    missed = ~seen_nodes(field, photographs, generator, config)
    around = torch.nn.functional.avg_pool3d(missed[None, None].float(), 3, 1, 1, count_include_pad=False)[0, 0]
    return replace(field, unknown=missed & (around >= config.least_neighbours))


def seen_nodes(
    field: VoxelField, photographs: PosedImages, generator: torch.Generator, config: SightConfig
) -> Bool[Tensor, "nx ny nz"]:
    """Which nodes of the field cameras saw into."""
    sampler = RaySampler(photographs, generator)
    scales = np.float32(DENSITY_SCALE), np.float32(field.step), np.float32(config.least_light)
    nx, ny, nz = field.shape
    left = max(1, round(config.rays_per_node * nx * ny * nz))
    with threads(default_threads()) as workers:
        counts = np.zeros((workers, nx, ny, nz), np.uint8)
        while left > 0:
            batch = sampler.draw(min(left, _RAYS_AT_ONCE))
            sight.count_sightings(field.kernel_grid, batch.origins, batch.directions, *scales, counts)
            left -= _RAYS_AT_ONCE
    return torch.from_numpy(counts.astype(np.uint16).sum(0) >= config.least_samples)
