"""Conservative occupancy of moved fields: what was solid or unproven before is not free afterwards.

A moved field has other values between its nodes than the old one had there. Each cell with a node that planners take
for free is compared with the old field on a lattice. Where something that was solid would now be free, all corners of
the cell become unproven, or, in a field without evidence, dense enough to be solid; what is interpolated
lies between its corners, so all of the cell is solid then.
"""

from dataclasses import replace

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from nerfnav.core.jit import default_threads, threads
from nerfnav.field.core.occupancy import Occupancy, raw_of
from nerfnav.field.core.protocol import density_in_box
from nerfnav.field.kernels.resample import mark_lost
from nerfnav.field.models.grid_field import GridField
from nerfnav.field.models.voxel import VoxelField
from nerfnav.geometry import Similarity, node_positions

_CORNERS = torch.cartesian_prod(torch.arange(2), torch.arange(2), torch.arange(2))
_ABOVE = 0.1
"""By how much raw densities that must be solid exceed the threshold: after a file has rounded them, too, they do."""
_LATTICE = (4, 1)
"""Parts into which the lattice divides the edges of a cell; and lattice points beside a solid one that must be solid,
too: so is what lies between the points."""

Nodes = Bool[Tensor, "nx ny nz"]


def preserve_occupancy(field: VoxelField, before: VoxelField, to_before: Similarity) -> VoxelField:
    """`field` with nodes taken out of free space, so that for planners all is solid that was solid in `before`.

    `to_before` takes points of now [m] to where they were.
    """
    now, then = field.planned, before.planned
    free = now.values[..., 0] <= raw_of(now.solid_density)
    lost = torch.cat([
        _lost_cells(now, then, to_before, free), _cells_of_lost_nodes(now, then, to_before.inverted())
    ])  # fmt: skip
    taken = torch.zeros(field.shape, dtype=torch.bool)
    x, y, z = (lost[:, None] + _CORNERS).reshape(-1, 3).unbind(-1)
    taken[x, y, z] = True
    return _solid_at(field, taken & free)


def least_solid_raw(field: GridField) -> float:
    """Raw density that planners surely take for solid in a grid, and no more: it shows in pictures."""
    return raw_of(field.solid_density) + _ABOVE


def is_solid(field: GridField, points: Float[np.ndarray, "n 3"]) -> Bool[np.ndarray, " n"]:
    """Mark points [m] that are solid for planners; beyond its border a field is as at the border."""
    return density_in_box(field.planned, points) > field.solid_density


def between_grids(field: GridField, before: GridField, to_before: Similarity) -> tuple[np.ndarray, np.ndarray]:
    """Matrix (3, 3) and shift (3) from grid coordinates of `field` to those of `before`."""
    first, second = (grid.box.size.double() / (torch.tensor(grid.shape) - 1) for grid in (field, before))
    matrix = to_before.scale * to_before.rotation * first / second[:, None]
    shift = (to_before(field.box.lower.double()) - before.box.lower.double()) / second
    return matrix.numpy(), shift.numpy()


def _solid_at(field: VoxelField, nodes: Nodes) -> VoxelField:
    """The field with some nodes solid for planners."""
    if field.evidence is not None:
        unproven = torch.tensor(int(Occupancy.UNPROVEN), dtype=torch.uint8)
        return replace(field, evidence=torch.where(nodes, unproven, field.evidence))
    values = field.values.clone()
    dense = values[..., 0].clamp_min(least_solid_raw(field))
    values[..., 0] = torch.where(nodes, dense, values[..., 0])
    return replace(field, values=values)


def _lost_cells(now: GridField, then: GridField, to_before: Similarity, free: Nodes) -> Int[Tensor, "n 3"]:
    """Return the cells with a `free` corner that lose something solid."""
    values, occupied, *_ = then.kernel_grid
    limits = tuple(np.float32(raw_of(one.solid_density)) for one in (then, now))
    cells = torch.nn.functional.max_pool3d(free[None, None].float(), 2, 1)[0, 0].numpy().astype(np.uint8)
    with threads(default_threads()):
        mark_lost(
            values, occupied, now.kernel_grid[0], cells, *between_grids(now, then, to_before), _LATTICE, limits,
        )  # fmt: skip
    return torch.from_numpy(cells).nonzero()


def _cells_of_lost_nodes(now: GridField, then: GridField, to_now: Similarity) -> Int[Tensor, "n 3"]:
    """Cells in which solid nodes stood that lie in free space now: specks that a lattice may miss."""
    found, solid = [], then.values[..., 0] > raw_of(then.solid_density)
    for plane, positions in zip(solid, node_positions(then.box, then.shape), strict=True):
        points = to_now(positions[plane].double())
        points = points[~torch.from_numpy(is_solid(now, points.numpy()))]
        found.append(((points - now.box.lower) / now.spacing).floor().long())
    cells = torch.cat(found)
    return torch.minimum(cells.clamp_min(0), torch.tensor(now.shape) - 2)
