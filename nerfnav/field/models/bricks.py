"""Brick field: a sparse grid that keeps only blocks that hold anything, so that a hall costs as much as its walls.

A brick has the nodes of a block of 4 x 4 x 4 cells, those on its borders included: 5 x 5 x 5, so that whatever lies
in the block is given by its brick alone. Brick 0 is empty and proven free, and stands for every block that is. Blocks
that are the same throughout (the inside of what no camera saw) share a brick.

Nothing is lost: a block is left out only where every node of it is as brick 0 has it.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float, Int, UInt8
from torch import Tensor

from nerfnav.field.core.occupancy import EMPTY_RAW, Occupancy
from nerfnav.field.core.protocol import Points
from nerfnav.field.kernels.cells import BLOCK_SHIFT
from nerfnav.field.models.grid_field import GridField, KernelGrid, grey_nodes
from nerfnav.field.models.voxel import VoxelField
from nerfnav.geometry import Box
from nerfnav.geometry.grid import cells_of, corner_offsets

CELLS = 1 << BLOCK_SHIFT
"""Cells along each edge of a block."""
NODES = CELLS + 1
"""Nodes along each edge of a brick."""
_BRICK = (NODES, NODES, NODES)


class Slab(NamedTuple):
    """A part of a grid along x."""

    values: Float[Tensor, "sx ny nz 4"]
    """Raw density and colour of each node."""
    states: UInt8[Tensor, "sx ny nz"] | None
    """Occupancy of each node; None where it was never determined."""


@dataclass(frozen=True)
class BrickField(GridField):
    """A radiance field on a regular grid of which only bricks (5, 5, 5) with something in them are kept."""

    nodes: tuple[int, int, int] = field(kw_only=True)
    """Numbers of nodes along x, y, z."""
    slots: Int[Tensor, "bx by bz"] = field(kw_only=True)
    """The brick of each block, int32."""

    @property
    def shape(self) -> tuple[int, int, int]:
        """Numbers of nodes along x, y, z."""
        return self.nodes

    def between_nodes(self, points: Points, channels: slice) -> Float[Tensor, "*batch c"]:
        """Interpolate between the nodes of bricks (see GridField)."""
        cell, weights = cells_of(self.box, self.nodes, points)
        x, y, z = (cell >> BLOCK_SHIFT).unbind(-1)
        i, j, k = (cell & (CELLS - 1)).unbind(-1)
        first = ((self.slots[x, y, z].long() * NODES + i) * NODES + j) * NODES + k
        at = first[:, None] + corner_offsets(NODES, NODES).to(first.device)
        nodes = self.values.reshape(-1, 4)[:, channels][at]
        return (weights[..., None] * nodes.to(points)).sum(1).reshape(*points.shape[:-1], -1)

    @property
    def unproven_by_height(self) -> Float[Tensor, " nz"] | None:
        """See GridField; blocks that stick out of the grid count whole."""
        if self.evidence is None:
            return None
        inner = self.evidence[:, :CELLS, :CELLS, :CELLS] == Occupancy.UNPROVEN  # borders belong to the next brick
        layers = inner.float().mean((1, 2))[self.slots.long()].mean((0, 1)).reshape(-1)
        return torch.cat([layers, layers[-1:]])[: self.nodes[2]]

    @cached_property
    def kernel_grid(self) -> KernelGrid:
        """See GridField; `occupied` are the slots, and behind the corner in `lower` stand the numbers of nodes."""
        per_meter = (1 / self.spacing).cpu().numpy().astype(np.float32)
        lower = np.concatenate([self.box.lower.cpu().numpy(), self.nodes]).astype(np.float32)
        return self.values.detach().cpu().numpy(), self.slots.cpu().numpy(), lower, per_meter


def convert_to_bricks(field: VoxelField) -> BrickField:
    """The same field, kept as bricks."""
    made = build_bricks(
        field.box,
        field.shape,
        lambda first, end: Slab(field.values[first:end], None if field.evidence is None else field.evidence[first:end]),
        field.background,
    )
    return replace(made, info=field.info, outside=field.outside)


def build_bricks(
    box: Box, nodes: tuple[int, int, int], slab: Callable[[int, int], Slab], background: Float[Tensor, "3"]
) -> BrickField:
    """A field of bricks whose dense grid is never held whole.

    `slab(first, end)` gives the nodes from `first` up to `end` along x: five layers at a time, the last of which is the
    first of the next. Either all slabs have states or none.
    """
    nx, ny, nz = nodes
    blocks = [-(-count // CELLS) for count in nodes]
    slots = torch.zeros(blocks, dtype=torch.int32)
    pool = _Pool()
    for x in range(blocks[0]):
        slots[x] = pool.slots_of(_padded(slab(x * CELLS, min(x * CELLS + NODES, nx)), (blocks[1], blocks[2])))
    values, states = pool.released()
    return BrickField(box, values, background, evidence=states, nodes=(nx, ny, nz), slots=slots)


class _Pool:
    """Bricks in the making."""

    def __init__(self) -> None:
        self._values, self._states, self._count = [grey_nodes((1, *_BRICK), EMPTY_RAW)], [_free(1, *_BRICK)], 1
        self._uniform: dict[tuple[float, ...], int] = {}
        self._determined = False

    def slots_of(self, layer: Slab) -> Int[Tensor, "by bz"]:
        """Keep what a layer of blocks (5, 4 by + 1, 4 bz + 1, ...) holds; returns the brick of each."""
        values, states = layer
        held = values[..., 0] > EMPTY_RAW + 1
        if states is not None:
            self._determined, held = True, held | (states != Occupancy.FREE)
        found = torch.nn.functional.max_pool3d(held[None, None].float(), NODES, CELLS)[0, 0, 0] > 0
        y, z = found.nonzero().unbind(-1)
        slots = torch.zeros(found.shape, dtype=torch.int32)
        bricks = values.unfold(1, NODES, CELLS).unfold(2, NODES, CELLS)[:, y, z].permute(1, 0, 3, 4, 2)
        known = _free(len(y), *_BRICK) if states is None else _blocks(states, y, z)
        slots[y, z] = self._added(bricks.contiguous(), known)
        return slots

    def released(self) -> tuple[Tensor, Tensor | None]:
        """All bricks (n, 5, 5, 5, 4), and their states where any were given; the pool is spent then."""
        values, states = torch.cat(self._values), torch.cat(self._states) if self._determined else None
        self._values, self._states = [], []
        return values, states

    def _added(self, bricks: Tensor, states: Tensor) -> Int[Tensor, " k"]:
        flat = bricks.flatten(1, 3)
        same = (flat == flat[:, :1]).flatten(1).all(1) & (states.flatten(1) == states[:, 0, 0, 0, None]).all(1)
        slots, new = torch.zeros(len(bricks), dtype=torch.int32), ~same
        for index in same.nonzero()[:, 0].tolist():
            key = (*flat[index, 0].tolist(), float(states[index, 0, 0, 0]))
            if key not in self._uniform:
                self._uniform[key] = self._keep(bricks[index : index + 1], states[index : index + 1])
            slots[index] = self._uniform[key]
        first, count = self._count, int(new.sum())
        if count:
            self._keep(bricks[new], states[new])
            slots[new] = torch.arange(first, first + count, dtype=torch.int32)
        return slots

    def _keep(self, bricks: Tensor, states: Tensor) -> int:
        first, self._count = self._count, self._count + len(bricks)
        self._values.append(bricks.clone())
        self._states.append(states.clone())
        return first


def _blocks(states: Tensor, y: Tensor, z: Tensor) -> UInt8[Tensor, "k 5 5 5"]:
    return states.unfold(1, NODES, CELLS).unfold(2, NODES, CELLS)[:, y, z].transpose(0, 1)


def _free(*size: int) -> UInt8[Tensor, "*nodes"]:
    return torch.full(size, int(Occupancy.FREE), dtype=torch.uint8)


def _padded(layer: Slab, blocks: tuple[int, int]) -> Slab:
    """Add empty nodes to a layer of blocks where the grid ends within one."""
    values, states = layer
    size = (NODES, *(CELLS * count + 1 for count in blocks))
    if tuple(values.shape[:3]) == size:
        return layer
    sx, ny, nz, _ = values.shape
    padded = grey_nodes(size, EMPTY_RAW)
    padded[:sx, :ny, :nz] = values
    if states is None:
        return Slab(padded, None)
    padded_states = _free(*size)
    padded_states[:sx, :ny, :nz] = states
    return Slab(padded, padded_states)
