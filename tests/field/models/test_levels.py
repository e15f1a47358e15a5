"""Ever coarser fields."""

import torch

from nerfnav.field.core.occupancy import DENSITY_SCALE
from nerfnav.field.models.analytic import BallsField
from nerfnav.field.models.levels import build_levels, coarser, raw_of
from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.render.volume_rendering import render_rays
from nerfnav.geometry.box import Box
from nerfnav.geometry.camera import Camera, look_at

BOX = Box.of((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5))


def ball(nodes: int = 33) -> VoxelField:
    """An opaque red ball in empty space with blue nodes."""
    axis = torch.linspace(-0.5, 0.5, nodes)
    x, y, z = torch.meshgrid(axis, axis, axis, indexing="ij")
    inside = (x.square() + y.square() + z.square()).sqrt() < 0.3
    raw = torch.where(inside, 1.0, -20.0)
    colors = torch.where(inside[..., None], torch.tensor([1.0, 0.0, 0.0]), torch.tensor([0.0, 0.0, 1.0]))
    return VoxelField(BOX, torch.cat([raw[..., None], colors], -1), torch.ones(3))


def test_each_level_has_nodes_twice_as_far_apart_until_there_are_too_few():
    shapes = [level.shape for level in build_levels(ball(), 5)]  # pyright: ignore[reportAttributeAccessIssue]
    assert shapes == [(33, 33, 33), (17, 17, 17), (9, 9, 9), (9, 9, 9), (9, 9, 9)]


def test_a_ball_stays_opaque_keeps_its_size_and_is_not_stained():
    camera = Camera.from_fov(48, 48, 60)
    rays = camera.rays(look_at(torch.tensor([1.2, 0.0, 0.0]), torch.zeros(3)))
    fine, coarse = (field.render_rays(*rays) for field in (ball(), coarser(ball())))
    middle = 24 * 48 + 24
    assert coarse.opacity[middle] > 0.99
    assert coarse.color[middle, 0] > 0.95 and coarse.color[middle, 2] < 0.05
    assert abs(coarse.opacity.mean() / fine.opacity.mean() - 1) < 0.1


def test_raw_values_are_those_of_the_densities():
    density = torch.tensor([0.5, 3.0, 90.0, 900.0])
    again = DENSITY_SCALE * torch.nn.functional.softplus(raw_of(density))
    torch.testing.assert_close(again, density, rtol=1e-4, atol=0)
    assert raw_of(torch.zeros(1)) == -20


def test_fields_without_a_grid_are_the_same_at_all_levels():
    balls = BallsField(BOX, torch.zeros(1, 3), torch.tensor([0.2]))
    assert all(level is balls for level in build_levels(balls, 3))
    assert render_rays(balls, torch.zeros(1, 3), torch.tensor([[1.0, 0.0, 0.0]])).opacity > 0.9
