"""Places made of solid boxes on a grid of any size, held as bricks: a warehouse hall, a house, and either scaled."""

from dataclasses import dataclass

import torch

from nerfnav.field.core.occupancy import EMPTY_RAW, Occupancy
from nerfnav.field.models.bricks import BrickField, Slab, build_bricks
from nerfnav.geometry.box import Box
from nerfnav.geometry.grid import shape_for

Point = tuple[float, float, float]
SOLID_RAW = 0.5
"""Of what stands there: 390 / m."""


@dataclass(frozen=True)
class Block:
    """A box that is not free."""

    lower: Point
    upper: Point
    state: Occupancy = Occupancy.SOLID
    """Unproven ones have no density."""
    color: Point = (0.6, 0.6, 0.6)


@dataclass(frozen=True)
class Building:
    """Blocks in a room."""

    size: Point
    """Of the room [m], from the origin."""
    blocks: tuple[Block, ...]

    def scaled(self, factor: float) -> "Building":
        """The same, so many times as large."""

        def times(point: Point) -> Point:
            return factor * point[0], factor * point[1], factor * point[2]

        blocks = (Block(times(b.lower), times(b.upper), b.state, b.color) for b in self.blocks)
        return Building(times(self.size), tuple(blocks))


def field_of(building: Building, voxel: float) -> BrickField:
    """The field of a building on nodes about `voxel` [m] apart; all that is not in a block is proven free."""
    box = Box.of((0.0, 0.0, 0.0), building.size)
    nodes = shape_for(box, voxel)
    axes = [torch.linspace(0, edge, count) for edge, count in zip(building.size, nodes, strict=True)]

    def slab(first: int, end: int) -> Slab:
        values = torch.full((end - first, nodes[1], nodes[2], 4), 0.5)
        values[..., 0] = EMPTY_RAW
        states = torch.full(values.shape[:3], int(Occupancy.FREE), dtype=torch.uint8)
        for block in building.blocks:
            part = _nodes_in(block, [axes[0][first:end], *axes[1:]])
            states[part] = int(block.state)
            if block.state is Occupancy.SOLID:
                values[part] = torch.tensor([SOLID_RAW, *block.color])
        return Slab(values, states)

    return build_bricks(box, nodes, slab, torch.ones(3))


def _nodes_in(block: Block, axes: list[torch.Tensor]) -> tuple[slice, ...]:
    """Nodes in the block; of one thinner than their distance, those next to its middle."""
    parts = []
    for axis, low, high in zip(axes, block.lower, block.upper, strict=True):
        inside = ((axis >= low - 1e-4) & (axis <= high + 1e-4)).nonzero()[:, 0].tolist()
        if not inside and len(axis) and axis[0] <= 0.5 * (low + high) <= axis[-1]:
            inside = [int((axis - 0.5 * (low + high)).abs().argmin())]
        parts.append(slice(inside[0], inside[-1] + 1) if inside else slice(0, 0))
    return tuple(parts)


def shell_of(size: Point, thick: float) -> list[Block]:
    """Floor, ceiling and outer walls."""
    (x, y, z), none = size, 0.0
    return [
        Block((none, none, none), (x, y, thick), color=(0.5, 0.5, 0.45)),
        Block((none, none, z - thick), (x, y, z)),
        Block((none, none, none), (thick, y, z)),
        Block((x - thick, none, none), (x, y, z)),
        Block((none, none, none), (x, thick, z)),
        Block((none, y - thick, none), (x, y, z)),
    ]


def hall() -> Building:
    """A warehouse of 40 x 30 x 12 m: pillars, shelves, thin beams, a partition with a door, a closed room."""
    size = (40.0, 30.0, 12.0)
    blocks = shell_of(size, 0.12)
    blocks += [
        Block((x - 0.3, y - 0.3, 0.0), (x + 0.3, y + 0.3, 12.0)) for x in range(6, 40, 7) for y in range(5, 30, 7)
    ]
    for row in range(4):  # shelves along x, their boards a metre apart
        y = 3.0 + 6.5 * row
        blocks += [Block((8.0, y, h), (18.0, y + 1.0, h + 0.08)) for h in (1.0, 2.0, 3.0, 4.0)]
        blocks += [
            Block((x, y + side, 0.0), (x + 0.08, y + side + 0.08, 4.1))
            for x in (8.0, 10.5, 13.0, 15.5, 17.9)
            for side in (0.0, 0.92)
        ]
    blocks += [Block((x, 0.0, 8.0), (x + 0.04, 30.0, 8.04)) for x in range(3, 40, 4)]  # beams one node thick
    blocks += [Block((22.0, 0.0, 0.0), (22.12, 20.0, 12.0)), Block((22.0, 22.0, 0.0), (22.12, 30.0, 12.0))]
    blocks += [Block((22.0, 20.0, 2.5), (22.12, 22.0, 12.0))]  # above the door
    blocks += [Block((30.0, 20.0, 0.0), (36.0, 26.0, 4.0), Occupancy.UNPROVEN)]  # a room that nobody looked into
    return Building(size, tuple(blocks))


def house() -> Building:
    """19 x 11 x 3 m in eight rooms with doors of 0.9 m along a corridor, and some furniture."""
    size = (19.0, 11.0, 3.0)
    blocks = shell_of(size, 0.12)
    for y in (4.8, 6.2):  # the corridor's walls, a door in the middle of each room
        for room in range(4):
            x = 4.75 * room
            blocks += [Block((x, y, 0.0), (x + 1.9, y + 0.12, 3.0))]
            blocks += [Block((x + 2.8, y, 0.0), (x + 4.75, y + 0.12, 3.0))]
            blocks += [Block((x + 1.9, y, 2.1), (x + 2.8, y + 0.12, 3.0))]
    for room in range(1, 4):
        x = 4.75 * room
        blocks += [Block((x, 0.0, 0.0), (x + 0.12, 4.8, 3.0)), Block((x, 6.32, 0.0), (x + 0.12, 11.0, 3.0))]
    for room in range(4):
        x = 4.75 * room
        blocks += [Block((x + 1.0, 1.0, 0.7), (x + 2.6, 1.9, 0.75))]  # a table
        blocks += [Block((x + dx, y, 0.0), (x + dx + 0.04, y + 0.04, 0.7)) for dx in (1.0, 2.5) for y in (1.0, 1.8)]
        blocks += [Block((x + 0.3, 9.5, 0.0), (x + 2.0, 10.8, 2.0), Occupancy.UNPROVEN)]  # a cupboard
    return Building(size, tuple(blocks))
