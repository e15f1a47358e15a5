"""Grid in training: node values with Adam's moments and each thread's gradients, all in numpy; and its empty start.

Memory: a node has 16 bytes of values and 4 of learning rate; where its block of 4 x 4 x 4 nodes has a slot, 32 more
for the moments and 16 for each thread's gradient. Only blocks that are not known to be empty have slots. Measured
with three threads, in all: 256^3 nodes take 1.3 GB where 40 % of the blocks hold something, and 2.1 GB where all
do.
"""

import math

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from nerfnav.field.kernels import adam
from nerfnav.field.kernels.cells import BLOCK_SHIFT
from nerfnav.field.models.grid_field import grey_nodes
from nerfnav.field.render.surroundings import SPAN, uncontracted
from nerfnav.field.train.training_volume import VALUE_BOUNDS, TrainingVolume
from nerfnav.geometry import Box, PosedImages, node_positions

_BLOCK_NODES = (1 << BLOCK_SHIFT) ** 3


class TrainedGrid:
    """Node values that learn by Adam from the gradients that threads have added up."""

    def __init__(
        self,
        values: Float[Tensor, "nx ny nz 4"],
        rate_scale: Float[Tensor, "nx ny nz"],
        workers: int,
        occupied: Bool[Tensor, "bx by bz"] | None = None,
    ) -> None:
        """Learn `values`, densities at rates times `rate_scale`, nodes of `occupied` blocks only or of all."""
        self.values = values.numpy().astype(np.float32, order="C")  # a copy: it will change
        self.rate_scale = np.ascontiguousarray(rate_scale.numpy(), np.float32)
        self._bounds = VALUE_BOUNDS.numpy().astype(np.float32)
        needed = _with_borders(all_blocks(self.shape) if occupied is None else occupied)
        self.slots = np.full(tuple(needed.shape), -1, np.int32)
        self._blocks = needed.nonzero().numpy().astype(np.int32)
        count = len(self._blocks)
        self.slots[needed.numpy()] = np.arange(count, dtype=np.int32)
        self.gradients = np.zeros((workers, count, _BLOCK_NODES, 4), np.float32)
        self.touched = np.zeros((workers, count), np.uint8)
        self._moments = np.zeros((2, count, _BLOCK_NODES, 4), np.float32)
        self._steps = 0

    @classmethod
    def nothing(cls, workers: int) -> "TrainedGrid":
        """A grid without nodes, for a field without surroundings."""
        return cls(torch.zeros(0, 0, 0, 4), torch.zeros(0, 0, 0), workers)

    @property
    def shape(self) -> tuple[int, int, int]:
        """Numbers of nodes along x, y, z."""
        nx, ny, nz, _ = self.values.shape
        return nx, ny, nz

    def smooth(self, density_weight: float, color_weight: float) -> None:
        """Add the gradient of the roughness of what rays have touched, weighed, to that of the rays."""
        adam.add_roughness(
            self.values, self._blocks, self.gradients, self.touched,
            np.array([density_weight, *[color_weight] * 3], np.float32),
        )  # fmt: skip

    def descend(self, density_rate: float, color_rate: float) -> None:
        """Take a step of Adam, and clear the gradients."""
        self._steps += 1
        corrections = np.array([1 - adam.FIRST**self._steps, 1 - adam.SECOND**self._steps], np.float32)
        rates = np.array([density_rate, *[color_rate] * 3], np.float32)
        adam.adam(
            self.values, self._blocks, self.gradients, self.touched, self._moments, rates, self.rate_scale,
            self._bounds, corrections,
        )  # fmt: skip

    def released(self) -> Float[Tensor, "nx ny nz 4"]:
        """The values, when there is nothing more to learn: gradients and moments give their memory back."""
        self.gradients, self.touched = self.gradients[:, :0].copy(), self.touched[:, :0].copy()
        self._moments = self._moments[:, :0].copy()
        return torch.from_numpy(self.values)

    def forget(self) -> None:
        """Clear the gradients of all threads."""
        self.gradients[:] = 0
        self.touched[:] = 0

    def refined(
        self, shape: tuple[int, int, int]
    ) -> tuple[Float[Tensor, "nx ny nz 4"], Float[Tensor, "nx ny nz"]]:
        """The same values, and the scale of their rates, between more nodes."""
        values, scale = torch.from_numpy(self.values), torch.from_numpy(self.rate_scale)
        return refined(values, shape), refined(scale[..., None], shape)[..., 0]

    def dense_gradient(self) -> Float[Tensor, "nx ny nz 4"]:
        """The sum of the gradients since the last step, on the nodes."""
        dense = torch.zeros(*(4 * count for count in self.slots.shape), 4)
        blocks = torch.from_numpy(self.gradients.sum(0)).reshape(-1, 4, 4, 4, 4)
        for (x, y, z), block in zip((4 * self._blocks).tolist(), blocks, strict=True):
            dense[x : x + 4, y : y + 4, z : z + 4] = block
        nx, ny, nz = self.shape
        return dense[:nx, :ny, :nz]


def refined(values: Float[Tensor, "mx my mz c"], shape: tuple[int, int, int]) -> Float[Tensor, "nx ny nz c"]:
    """Node values interpolated to another number of nodes, channel by channel to spare memory."""
    fine = values.new_empty(*shape, values.shape[-1])
    for channel in range(values.shape[-1]):
        coarse = values[..., channel][None, None]
        fine[..., channel] = torch.nn.functional.interpolate(coarse, shape, mode="trilinear", align_corners=True)[0, 0]
    return fine


def training_bytes(nodes: int, workers: int) -> int:
    """Largest memory that training a grid of so many nodes takes [bytes]: when no block is known to be empty."""
    return nodes * (16 + 4 + 32 + 16 * workers)


def _with_borders(occupied: Bool[Tensor, "bx by bz"]) -> Bool[Tensor, "bx by bz"]:
    """Occupied blocks of cells and, as their cells end at nodes of these, those that follow along each axis."""
    needed = occupied.clone()
    for axis in range(3):
        after = needed.narrow(axis, 0, max(0, needed.shape[axis] - 1)).clone()
        needed.narrow(axis, min(1, needed.shape[axis]), max(0, needed.shape[axis] - 1)).logical_or_(after)
    return needed


_START_OUTSIDE = -4.5  # about half of the light passes all shells


def views_of(points: Float[Tensor, "*batch 3"], photographs: PosedImages) -> Float[Tensor, "*batch"]:
    """The share of cameras, relative to the best seen point, whose picture contains each point (walls ignored)."""
    flat = points.reshape(-1, 3)
    seen = torch.zeros(len(flat))
    for index in range(len(photographs)):
        _, inside = photographs.camera.project(photographs.poses[index], flat)
        seen += inside
    return (seen / seen.max().clamp_min(1)).reshape(points.shape[:-1])


_MOST_ASKED = 150_000
"""Nodes that each camera is asked about. The share of cameras changes over many nodes, so that finer grids interpolate
it: five million nodes and 400 cameras would take three minutes."""


def views_of_nodes(box: Box, shape: tuple[int, int, int], photographs: PosedImages) -> Float[Tensor, "nx ny nz"]:
    """`views_of` the nodes of a grid, on a coarser grid where there are many, trilinear between its nodes."""
    every = math.ceil((math.prod(shape) / _MOST_ASKED) ** (1 / 3))
    nx, ny, nz = (-(-(count - 1) // every) + 1 for count in shape)
    seen = views_of(node_positions(box, (nx, ny, nz)), photographs)
    return seen if every == 1 else refined(seen[..., None], shape)[..., 0]


def clear_around(place: TrainingVolume, photographs: PosedImages, outside: int, workers: int) -> TrainedGrid:
    """Surroundings on a grid of `outside`^3 nodes in which nothing is known yet; 0 for a plain background."""
    if outside == 0:
        return TrainedGrid.nothing(workers)
    grid = (outside, outside, outside)
    seen = views_of(uncontracted(place.box, node_positions(SPAN, grid)), photographs)
    return TrainedGrid(grey_nodes(grid, _START_OUTSIDE), seen, workers)


def all_blocks(shape: tuple[int, int, int]) -> Bool[Tensor, "bx by bz"]:
    x, y, z = (-(-count // 4) for count in shape)
    return torch.ones(x, y, z, dtype=torch.bool)
