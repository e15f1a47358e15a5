"""Grids in which nothing is known yet."""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from nerfnav.field.learned_place import VALUE_BOUNDS, Place
from nerfnav.field.surroundings import SPAN, uncontracted
from nerfnav.field.trained_grid import TrainedGrid
from nerfnav.geometry import PosedImages, node_positions

_START_OUTSIDE = -4.5  # about half of the light gets through all shells


def views_of(points: Float[Tensor, "*batch 3"], photographs: PosedImages) -> Float[Tensor, "*batch"]:
    """The share of cameras, relative to the best seen point, whose picture contains each point (walls ignored)."""
    flat = points.reshape(-1, 3)
    seen = torch.zeros(len(flat))
    for index in range(len(photographs)):
        _, inside = photographs.camera.project(photographs.poses[index], flat)
        seen += inside
    return (seen / seen.max().clamp_min(1)).reshape(points.shape[:-1])


def clear_around(place: Place, photographs: PosedImages, outside: int, workers: int) -> TrainedGrid:
    """Surroundings on a grid of `outside`^3 nodes in which nothing is known yet; 0 for a plain background."""
    if outside == 0:
        return TrainedGrid.nothing(workers)
    grid = (outside, outside, outside)
    seen = views_of(uncontracted(place.box, node_positions(SPAN, grid)), photographs)
    return TrainedGrid(clear(grid, _START_OUTSIDE), seen, all_blocks(grid), VALUE_BOUNDS, workers)


def clear(shape: tuple[int, int, int], raw: float) -> Float[Tensor, "nx ny nz 4"]:
    values = torch.full((*shape, 4), 0.5)
    values[..., 0] = raw
    return values


def all_blocks(shape: tuple[int, int, int]) -> Bool[Tensor, "bx by bz"]:
    x, y, z = (-(-count // 4) for count in shape)
    return torch.ones(x, y, z, dtype=torch.bool)
