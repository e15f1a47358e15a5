"""A small place that is moved about, and what its fields show and let planners do before and after."""

import math

import numpy as np
import torch

from nerfnav.core.steps import run_steps
from nerfnav.field.core.occupancy import DENSITY_SCALE, EMPTY_RAW, Occupancy
from nerfnav.field.core.protocol import Field
from nerfnav.field.edit.conservative_occupancy import is_solid
from nerfnav.field.edit.move import move_field
from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.render.surroundings import SPAN, Surroundings
from nerfnav.field.render.volume_rendering import render_image
from nerfnav.geometry.box import Box
from nerfnav.geometry.camera import Camera, look_at
from nerfnav.geometry.grid import node_positions
from nerfnav.geometry.images import psnr_db
from nerfnav.geometry.similarity import Similarity
from nerfnav.geometry.so3 import exp


def room(evidence: bool = True, outside: bool = False) -> VoxelField:
    """A floor, a thin wall and a ball in a box of 1.2 m, in voxels of 3 cm; a corner of it is unproven."""
    box = Box.of((-0.6, -0.6, -0.1), (0.6, 0.6, 0.8))
    points = node_positions(box, (41, 41, 31))
    x, y, z = points.unbind(-1)
    floor, wall = -z, 0.031 - (x - 0.32).abs()  # signed: above 0 inside
    ball = 0.16 - (points - torch.tensor([-0.2, 0.1, 0.3])).norm(dim=-1)
    inside = torch.maximum(torch.maximum(floor, wall), ball)
    density = 300 * torch.sigmoid(inside / 0.006)
    raw = torch.expm1((density / DENSITY_SCALE).double()).log().clamp_min(EMPTY_RAW).float()
    colors = torch.stack([0.5 + 0.4 * torch.sin(4 * x), 0.5 + 0.4 * torch.cos(3 * y), (0.2 + z).clamp(0, 1)], -1)
    states = torch.where(raw > -4.37, int(Occupancy.SOLID), int(Occupancy.FREE)).to(torch.uint8)
    states[:8, :8, 12:20] = int(Occupancy.UNPROVEN)
    return VoxelField(
        box,
        torch.cat([raw[..., None], colors], -1),
        torch.tensor([0.7, 0.8, 0.9]),
        outside=_hills() if outside else None,
        evidence=states if evidence else None,
    )


def _hills() -> Surroundings:
    """Half-opaque shells, of colours that change slowly with direction."""
    u = node_positions(SPAN, (32, 32, 32))
    raw = torch.where(u[..., 2] < 0.6, 0.0, -6.0)
    return Surroundings(torch.cat([raw[..., None], 0.5 + 0.2 * u], -1))


def change(tilt: tuple[float, float, float] = (0.0, 0.0, 0.0), scale: float = 1.0, shift: float = 0.0) -> Similarity:
    """A rotation by a rotation vector [rad], a scale, and a shift along all axes [m]."""
    rotation = exp(torch.tensor(tilt, dtype=torch.float64))
    return Similarity(rotation, torch.full((3,), shift, dtype=torch.float64), scale)


def after(field: VoxelField, similarity: Similarity) -> VoxelField:
    """The field once it is moved."""
    moved = run_steps(move_field(field, similarity))
    assert isinstance(moved, VoxelField)
    return moved


def likeness(before: Field, now: Field, similarity: Similarity, inside: bool = False) -> float:
    """PSNR [dB] of pictures of a field against those that moved cameras take of the moved one."""
    camera, center = Camera.from_fov(72, 54, 70), before.box.center
    reach = 0.3 if inside else 1.1
    errors = []
    for index in range(6):
        around = torch.tensor([math.cos(index), math.sin(index), 0.5])
        pose = look_at(center + reach * before.box.size * around, center - 0.2 * around)
        pictures = render_image(before, camera, pose).color, render_image(now, camera, similarity.pose(pose)).color
        errors.append(pictures[0] - pictures[1])
    return psnr_db(torch.stack(errors).square().mean().item())


def freed(before: VoxelField, now: VoxelField, similarity: Similarity, count: int = 60_000) -> tuple[int, float]:
    """How many of random points that planners took for solid they take for free now, and the share of free ones lost.
    """
    generator = torch.Generator().manual_seed(5)
    points = before.box.lower + torch.rand(count, 3, generator=generator) * before.box.size
    there = similarity(points.double())
    held = now.box.contains(there.float()).numpy()
    was, remains = is_solid(before, points.double().numpy()), is_solid(now, there.numpy())
    return int((was & ~remains & held).sum()), float(np.mean(remains[~was & held]))
