"""What photographs alone prove: air before patterns, and nothing about a plain wall."""

from dataclasses import replace

import pytest
import torch

from nerfnav.field.carving import carved, noise_of
from nerfnav.field.evidence import State, states_of
from nerfnav.field.unknown import Unknown, planning_field
from nerfnav.geometry.grid import node_positions
from tests.field import rooms

NODES, AWAY = node_positions(rooms.BOX, rooms.SHAPE), rooms.distances()


@pytest.fixture(scope="module")
def free() -> torch.Tensor:
    return carved(rooms.field_without_the_plain_wall(), rooms.photographs().without_depth())


def test_no_surface_is_proven_free_though_the_field_shows_nothing_of_it(free: torch.Tensor):
    plain_wall = ((NODES[..., 0] - rooms.HALF).abs() < 0.9 * rooms.VOXEL) & (NODES[..., 1:].abs().amax(-1) < 0.9)
    assert plain_wall.sum() > 1000
    assert free[plain_wall].float().mean() < 0.01
    assert free[AWAY.abs() < 0.9 * rooms.VOXEL].float().mean() < 0.01


def test_air_is_proven_free(free: torch.Tensor):
    assert free[AWAY > 3 * rooms.VOXEL].float().mean() > 0.8
    assert free[(AWAY > 3 * rooms.VOXEL) & (NODES[..., 0] < 0.3)].float().mean() > 0.9


def test_what_no_camera_looks_at_is_unproven(free: torch.Tensor):
    assert not free[NODES.abs().amax(-1) > rooms.HALF + 1.5 * rooms.VOXEL].any()


def test_planners_meet_the_plain_wall_that_the_field_does_not_show(free: torch.Tensor):
    field = rooms.field_without_the_plain_wall()
    field = replace(field, evidence=states_of(free, field.values[..., 0]))
    wall = torch.tensor([[rooms.HALF, 0.3, 0.2], [rooms.HALF, -0.5, -0.4]])
    assert (field.density(wall) < 1).all()
    assert (planning_field(field, Unknown.OCCUPIED).density(wall) > 5).all()
    assert (planning_field(field, Unknown.FREE).density(wall) < 1).all()
    assert field.evidence is not None and (field.evidence == State.SOLID).any()


def test_rays_that_show_nothing_but_the_sky_prove_their_way():
    field = rooms.field_without_the_plain_wall()
    empty = replace(field, values=torch.where(torch.tensor([True, False, False, False]), -20.0, field.values))
    taken = rooms.photographs(12).without_depth()
    sky = torch.tensor([178, 204, 230], dtype=torch.uint8).expand_as(taken.images).contiguous()
    assert carved(empty, replace(taken, images=sky))[AWAY > 2 * rooms.VOXEL].float().mean() > 0.9
    grey = torch.full_like(sky, 128)
    assert not carved(empty, replace(taken, images=grey)).any()


def test_the_pictures_own_noise_is_found_whatever_they_show():
    taken = rooms.photographs(6, size=96).without_depth()
    assert noise_of(taken) < 0.5
    noise = 5 * torch.randn(taken.images.shape, generator=torch.Generator().manual_seed(0))
    noisy = (taken.images.float() + noise).clamp(0, 255).round().to(torch.uint8)
    assert noise_of(replace(taken, images=noisy)) == pytest.approx(5, rel=0.3)
