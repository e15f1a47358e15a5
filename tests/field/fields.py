"""Small fields that several tests look at."""

import copy
import math
from dataclasses import replace
from functools import cache

import numpy as np
import torch
import trimesh

from nerfnav.field.models.analytic import BallsField
from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.render.surroundings import Surroundings
from nerfnav.field.render.volume_rendering import render_image
from nerfnav.field.surface.texture import TexturedMesh
from nerfnav.geometry.box import Box
from nerfnav.geometry.camera import Camera, Pose, look_at
from nerfnav.geometry.images import PosedImages

BOX = Box.of((-1, -1, -0.5), (1, 1, 0.6))


def random_voxels(seed: int = 0, dtype: torch.dtype = torch.float32) -> VoxelField:
    """Fog of random density and colour."""
    generator = torch.Generator().manual_seed(seed)
    values = torch.rand(21, 23, 13, 4, generator=generator, dtype=dtype)
    values[..., 0] = values[..., 0] * 6 - 9
    return VoxelField(BOX, values, torch.tensor([0.2, 0.5, 0.8], dtype=dtype))


def random_rays(count: int, seed: int = 0) -> tuple[torch.Tensor, torch.Tensor]:
    """Rays from inside and around the box, in all directions."""
    generator = torch.Generator().manual_seed(seed)
    origins = torch.rand(count, 3, generator=generator) * 3 - 1.5
    directions = torch.randn(count, 3, generator=generator)
    return origins, torch.nn.functional.normalize(directions, dim=-1)


def random_voxels_in_a_room(seed: int = 0) -> VoxelField:
    """The fog, with surroundings of random density and colour."""
    generator = torch.Generator().manual_seed(seed + 100)
    around = torch.rand(20, 20, 20, 4, generator=generator)
    around[..., 0] = around[..., 0] * 6 - 5
    return replace(random_voxels(seed), outside=Surroundings(around))


def ball() -> BallsField:
    """One coloured ball in the middle of a clear box."""
    return BallsField(BOX, torch.zeros(1, 3), torch.tensor([0.3]))


def photographs_of_ball(count: int, size: int = 48, turn: float = 0.0) -> PosedImages:
    """Pictures of the ball from a ring around it, to do with as one likes; `turn` [rad] moves the whole ring."""
    return copy.deepcopy(_photographs_of_ball(count, size, turn))


@cache
def _photographs_of_ball(count: int, size: int, turn: float) -> PosedImages:
    camera, poses = _ring(count, size, turn)
    images = [(render_image(ball(), camera, pose).color * 255).round().to(torch.uint8) for pose in poses]
    return PosedImages(torch.stack(images), camera, Pose.stack(poses))


def black_photographs(count: int, size: int) -> PosedImages:
    """Pictures from the same ring that show nothing, for what asks only where they were taken: they cost nothing."""
    camera, poses = _ring(count, size, 0.0)
    return PosedImages(torch.zeros(count, size, size, 3, dtype=torch.uint8), camera, Pose.stack(poses))


def _ring(count: int, size: int, turn: float) -> tuple[Camera, list[Pose]]:
    angles = torch.arange(count) * 2.399963 + turn  # the golden angle spreads them
    heights = torch.linspace(-0.4, 0.5, count)
    poses = [
        look_at(torch.tensor([0.95 * a.cos(), 0.95 * a.sin(), z]), torch.zeros(3))
        for a, z in zip(angles, heights, strict=True)
    ]
    return Camera.from_fov(size, size, 60), poses


def painted(mesh: trimesh.Trimesh, colors: np.ndarray) -> TexturedMesh:
    """The mesh with a picture of 8 x 8 texels for each vertex, of its sRGB colour (n, 3)."""
    side = math.ceil(math.sqrt(len(colors)))
    blocks = np.zeros((side * side, 3), np.uint8)
    blocks[: len(colors)] = colors
    picture = blocks.reshape(side, side, 3).repeat(8, axis=0).repeat(8, axis=1)
    row, column = np.divmod(np.arange(len(colors)), side)
    uv = (np.stack([column, row], 1) + 0.5) / side
    return TexturedMesh(np.asarray(mesh.vertices), np.asarray(mesh.faces), uv, picture)
