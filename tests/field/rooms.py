"""A small room whose walls are patterned but for one, which is plain: what pictures prove there, and what not."""

import math

import numpy as np
import torch
import trimesh

from nerfnav.field.core.occupancy import EMPTY_RAW
from nerfnav.field.models.voxel import VoxelField
from nerfnav.geometry.box import Box
from nerfnav.geometry.camera import Camera, Pose, look_at
from nerfnav.geometry.grid import node_positions
from nerfnav.geometry.images import PosedImages
from nerfnav.world.capture import photograph
from nerfnav.world.raycast import MeshRenderer
from nerfnav.world.scene import Scene

HALF = 1.0
"""Half the room's inner edge [m]."""
BOX = Box.of((-1.2, -1.2, -1.2), (1.2, 1.2, 1.2))
VOXEL = 0.06
SHAPE = (41, 41, 41)


def room(tile: float = 0.5, seed: int = 0) -> Scene:
    """Walls of tiles in all colours, and at x = HALF a plain one; a plain table stands in the middle.

    Tiles are triangles whose two equal edges are at most `tile` long [m].
    """
    mesh = trimesh.creation.box((2 * HALF,) * 3)
    for _ in range(math.ceil(math.log2(2 * HALF / tile))):
        mesh = mesh.subdivide()
    colors = np.random.default_rng(seed).integers(20, 235, (len(mesh.faces), 4), np.uint8)
    colors[mesh.triangles_center[:, 0] > HALF - 1e-6] = 200
    table = trimesh.creation.box((0.5, 0.5, 0.12))
    mesh.visual.face_colors, table.visual.face_colors = colors, [150, 60, 60, 255]
    both = trimesh.util.concatenate([mesh, table])
    return Scene("room", "Room", both, (table,), BOX, (0.7, 0.8, 0.9), ())


def photographs(count: int = 90, size: int = 64, tile: float = 0.5, seed: int = 0) -> PosedImages:
    """Pictures of the room with their depth, from all over it: `count` of `size` by `size` pixels."""
    generator = torch.Generator().manual_seed(seed)
    eyes = (2 * torch.rand(count, 3, generator=generator) - 1) * 0.85 * HALF
    eyes[:, 2] += torch.where(eyes[:, 2] > 0, 0.1, -0.1)  # not in the table
    aims = (2 * torch.rand(count, 3, generator=generator) - 1) * HALF
    renderer = MeshRenderer(room(tile, seed), supersample=2)
    return photograph(renderer, Camera.from_fov(size, size, 90), look_at(eyes, aims))


def distances() -> torch.Tensor:
    """Distance of each node from the nearest wall or the table [m], below 0 in the table and behind walls."""
    nodes = node_positions(BOX, SHAPE)
    out = nodes.abs() - torch.tensor([0.25, 0.25, 0.06])
    table = out.clamp_min(0).norm(dim=-1) + out.amax(-1).clamp_max(0)
    return torch.minimum(HALF - nodes.abs().amax(-1), table)


def field_without_the_plain_wall() -> VoxelField:
    """What photographs well: opaque patterned walls and the table, and nothing at all where the plain wall is."""
    nodes, away = node_positions(BOX, SHAPE), distances()
    values = torch.full((*SHAPE, 4), 0.5)
    plain = nodes[..., 0] > nodes[..., 1:].abs().amax(-1)
    values[..., 0] = torch.where((away < 0.25 * VOXEL) & ~(plain & (nodes[..., 0] > 0.6)), 1.0, EMPTY_RAW)
    return VoxelField(BOX, values, torch.tensor([0.7, 0.8, 0.9]))


def cameras(taken: PosedImages) -> tuple[Camera, Pose]:
    """Where pictures were taken from."""
    return taken.camera, taken.poses
