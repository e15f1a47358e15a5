"""Compiled passage from one grid to another, against torch."""

import math

import numpy as np
import torch

from nerfnav.field.core.occupancy import DENSITY_SCALE, SOLID_DENSITY, raw_of
from nerfnav.field.edit.conservative_occupancy import between_grids
from nerfnav.field.kernels.resample import mark_lost, measure_turned
from nerfnav.field.models.voxel import VoxelField
from nerfnav.geometry.grid import node_positions, trilinear
from tests.field.moves import after, change, room

BACK = change((0.3, -0.5, 0.2), scale=1.3, shift=0.2)


def grids() -> tuple[VoxelField, VoxelField]:
    """A field, and a coarser one in whose coordinates it is turned."""
    field = room(evidence=False)
    turned = after(field, BACK.inverted())
    return field, VoxelField(turned.box, turned.values[::2, ::2, ::2].contiguous(), turned.background)


def test_measured_nodes_are_means_of_density_and_of_colour_by_density() -> None:
    field, grid = grids()
    offsets = torch.tensor([[0.0, 0.0, 0.0], [0.3, -0.2, 0.1], [-0.4, 0.4, 0.2]], dtype=torch.float64)
    weights = torch.tensor([0.5, 0.3, 0.2])
    measured = np.zeros((*grid.shape, 4), np.float32)
    values, occupied, *_ = field.kernel_grid
    arguments = (*between_grids(grid, field, BACK), offsets.numpy(), weights.numpy(), measured)
    measure_turned(values, occupied, np.float32(DENSITY_SCALE), *arguments)
    points = BACK(node_positions(grid.box, grid.shape).double()[..., None, :] + offsets * grid.spacing.double()).float()
    density = weights * field.density(points)
    colors = (density[..., None] * trilinear(field.values[..., 1:], field.box, points)).sum(-2)
    total = density.sum(-1)
    dense = total > 1
    assert 200 < dense.sum() < dense.numel()
    np.testing.assert_allclose(measured[..., 0][dense], total[dense], rtol=2e-2)
    np.testing.assert_allclose(measured[..., 1:][dense], (colors / total[..., None])[dense], atol=2e-3)


def test_lost_cells_are_those_with_a_lattice_point_that_was_solid_and_is_free() -> None:
    field, grid = grids()
    limit, parts = raw_of(SOLID_DENSITY), 4
    cells = np.ones([count - 1 for count in grid.shape], np.uint8)
    values, occupied, *_ = field.kernel_grid
    mark_lost(
        values, occupied, grid.kernel_grid[0], cells, *between_grids(grid, field, BACK), (parts, 0),
        (np.float32(limit), np.float32(limit)),
    )  # fmt: skip
    index = torch.tensor(np.argwhere(np.ones_like(cells)))[:: math.ceil(cells.size / 3000)]
    share = torch.linspace(0, 1, parts + 1)
    lattice = torch.cartesian_prod(share, share, share)
    points = grid.box.lower + (index[:, None] + lattice) * grid.spacing
    before = trilinear(field.values[..., :1], field.box, BACK(points))[..., 0]
    before[~field.box.contains(BACK(points))] = -20.0
    now = trilinear(grid.values[..., :1], grid.box, points)[..., 0]
    # what is near the limit, or the border, may be either by rounding
    surely = ((before > limit + 0.02) & (now < limit - 0.02)).any(1).numpy()
    maybe = ((before > limit - 0.02) & (now < limit + 0.02)).any(1).numpy()
    found = cells[tuple(index.T.numpy())].astype(bool)
    assert surely.sum() > 20
    assert found[surely].all() and not (found & ~maybe).mean() > 0.01
