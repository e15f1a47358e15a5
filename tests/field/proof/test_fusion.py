"""What depth maps tell: surfaces where they are, plain or not, and free space before them."""

from dataclasses import replace

import pytest
import torch

from nerfnav.core.steps import run_steps
from nerfnav.field.core.occupancy import SOLID_DENSITY, Occupancy, classify_nodes
from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.proof.fusion import FusedDepth, fuse_depth
from nerfnav.field.train.config import TrainConfig
from nerfnav.field.train.loop import train
from tests.field import rooms

AWAY = rooms.distances()
SURFACE = torch.tensor([[1.0, 0.3, 0.2], [1.0, -0.5, -0.4], [0.1, -1.0, 0.3], [0.1, 0.1, 0.06], [-0.25, 0.0, 0.02]])


@pytest.fixture(scope="module")
def depth() -> FusedDepth:
    return fuse_depth(rooms.photographs(), rooms.BOX, rooms.SHAPE)


def test_air_is_proven_free_and_surfaces_are_not(depth: FusedDepth):
    assert depth.free[AWAY > 2 * rooms.VOXEL].float().mean() > 0.95
    assert not depth.free[AWAY < 0.5 * rooms.VOXEL].any()


def test_density_begins_at_the_surface_and_is_opaque_a_voxel_behind_it(depth: FusedDepth):
    values = torch.cat([depth.raw[..., None], depth.color], -1)
    field = VoxelField(rooms.BOX, torch.where(depth.known[..., None], values, -20.0), torch.zeros(3))
    outward = torch.nn.functional.normalize(torch.tensor(
        [[1.0, 0, 0], [1.0, 0, 0], [0, -1.0, 0], [0, 0, -1.0], [1.0, 0, 0]]
    ), dim=-1)  # fmt: skip
    assert (field.density(SURFACE + 0.6 * rooms.VOXEL * outward) > 100).all()
    assert (field.density(SURFACE - 1.5 * rooms.VOXEL * outward) < SOLID_DENSITY).all()


def test_a_plain_wall_gets_its_colour(depth: FusedDepth):
    near = depth.known & ~depth.free & (AWAY.abs() < rooms.VOXEL)
    wall = torch.zeros_like(near)
    wall[37, 10:31, 10:31] = True
    assert (depth.color[near & wall] - 200 / 255).abs().max() < 0.1


def test_where_nobody_measured_nothing_is_told():
    taken = rooms.photographs(8)
    assert taken.depth is not None
    blind = replace(taken, depth=torch.full_like(taken.depth, torch.nan))
    nothing = fuse_depth(blind, rooms.BOX, rooms.SHAPE)
    assert not nothing.known.any()
    with pytest.raises(ValueError, match="no depth"):
        fuse_depth(taken.without_depth(), rooms.BOX, rooms.SHAPE)


def test_noisy_depth_proves_nearly_as_much_and_keeps_surfaces_solid():
    taken = rooms.photographs(60)
    assert taken.depth is not None
    noise = 1 + 0.01 * torch.randn(taken.depth.shape, generator=torch.Generator().manual_seed(0))
    depth = fuse_depth(replace(taken, depth=taken.depth * noise, depth_noise=0.01), rooms.BOX, rooms.SHAPE)
    assert depth.free[AWAY > 2.5 * rooms.VOXEL].float().mean() > 0.9
    assert depth.free[(AWAY < 0.5 * rooms.VOXEL) & (AWAY > -0.5 * rooms.VOXEL)].float().mean() < 0.02


def test_training_keeps_what_depth_tells_and_says_so():
    taken = rooms.photographs()
    config = TrainConfig(voxel=rooms.VOXEL, iterations=60, rays=2048)
    background, generator = torch.tensor([0.7, 0.8, 0.9]), torch.Generator().manual_seed(0)
    learned, held_out = taken.subset(slice(0, 80)), taken.subset(slice(80, 84))
    field = run_steps(train(learned, held_out, rooms.BOX, background, config, generator))
    assert field.evidence is not None and field.info.psnr_db is not None
    assert field.info.learned_from == "pictures and depth"
    assert field.info.psnr_db > 20
    assert (field.planned.density(SURFACE) > SOLID_DENSITY).all()
    assert (field.evidence[AWAY > 2 * rooms.VOXEL] == Occupancy.FREE).float().mean() > 0.95


def test_states_are_free_solid_or_unproven():
    raw = torch.tensor([[[-20.0, 0.0, -8.0]]])
    free = torch.tensor([[[True, False, False]]])
    assert classify_nodes(free, raw).tolist() == [[[Occupancy.FREE, Occupancy.SOLID, Occupancy.UNPROVEN]]]
