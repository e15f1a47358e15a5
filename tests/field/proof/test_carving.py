"""What photographs alone prove: air before patterns, and nothing about a plain wall."""

from dataclasses import replace

import pytest
import torch

from nerfnav.field.core.occupancy import Occupancy, UnknownSpace, classify_nodes, planning_field
from nerfnav.field.proof.carving import CarvingConfig, carve_free_space, erode_isolated, estimate_noise
from nerfnav.geometry.grid import node_positions
from nerfnav.geometry.images import PosedImages
from tests.field import rooms

NODES, AWAY = node_positions(rooms.BOX, rooms.SHAPE), rooms.distances()


PLAIN_WALL = ((NODES[..., 0] - rooms.HALF).abs() < 0.9 * rooms.VOXEL) & (NODES[..., 1:].abs().amax(-1) < 0.9)
SURFACE, AIR = AWAY.abs() < 0.9 * rooms.VOXEL, AWAY > 3 * rooms.VOXEL


@pytest.fixture(scope="module")
def free() -> torch.Tensor:
    return carve_free_space(rooms.field_without_the_plain_wall(), rooms.photographs().without_depth())


def share(of: torch.Tensor, where: torch.Tensor) -> float:
    return of[where].float().mean().item()


def noisy(taken: PosedImages, deviation: float) -> PosedImages:
    noise = deviation * torch.randn(taken.images.shape, generator=torch.Generator().manual_seed(0))
    return replace(taken, images=(taken.images.float() + noise).clamp(0, 255).round().to(torch.uint8))


@pytest.mark.parametrize("noise", [0.0, 5.0])
@pytest.mark.parametrize(
    ("count", "size", "tile"), [(20, 96, 0.5), (40, 64, 1.0), (60, 48, 0.25), (60, 64, 0.0625), (100, 64, 0.125)]
)
def test_no_surface_is_proven_free_whatever_the_pictures_show(count: int, size: int, tile: float, noise: float):
    taken = noisy(rooms.photographs(count, size, tile, seed=count).without_depth(), noise)
    proven = carve_free_space(rooms.field_without_the_plain_wall(), taken)
    assert proven.any()
    assert PLAIN_WALL.sum() > 1000
    assert share(proven, PLAIN_WALL) < 0.001
    assert share(proven, SURFACE) < 0.001


@pytest.mark.parametrize(("tile", "seed"), [(1.0, 1), (0.5, 2), (0.5, 3)])
def test_air_before_large_patterns_is_proven_free_by_many_pictures(tile: float, seed: int):
    proven = carve_free_space(
        rooms.field_without_the_plain_wall(), rooms.photographs(tile=tile, seed=seed).without_depth()
    )
    assert share(proven, AIR) > 0.9
    assert share(proven, AIR & (NODES[..., 0] < 0.3)) > 0.9
    assert share(proven, SURFACE) < 0.001


@pytest.mark.slow
def test_fewer_pictures_and_finer_patterns_prove_less():
    field, taken = rooms.field_without_the_plain_wall(), rooms.photographs(tile=0.25).without_depth()
    many, few = carve_free_space(field, taken), carve_free_space(field, taken.subset(slice(30)))
    assert share(few, AIR) < 0.5 * share(many, AIR)
    assert not (few & ~many).any(), "what some of the pictures prove, all of them do"
    fine = carve_free_space(field, rooms.photographs(tile=0.0625).without_depth())
    assert share(fine, AIR) < share(many, AIR), "patterns finer than a voxel blur to one colour"


def test_a_node_is_proven_in_the_company_of_those_before_a_wall_and_not_alone():
    before_a_wall = torch.zeros(8, 8, 8, dtype=torch.bool)
    before_a_wall[:5] = True
    assert (erode_isolated(before_a_wall, CarvingConfig.company) == before_a_wall).all()
    lone = torch.zeros(8, 8, 8, dtype=torch.bool)
    lone[2:4, 2:4, 2:4] = True
    assert not erode_isolated(lone, CarvingConfig.company).any()


def test_what_no_camera_looks_at_is_unproven(free: torch.Tensor):
    assert not free[NODES.abs().amax(-1) > rooms.HALF + 1.5 * rooms.VOXEL].any()


def test_planners_meet_the_plain_wall_that_the_field_does_not_show(free: torch.Tensor):
    field = rooms.field_without_the_plain_wall()
    field = replace(field, evidence=classify_nodes(free, field.values[..., 0]))
    wall = torch.tensor([[rooms.HALF, 0.3, 0.2], [rooms.HALF, -0.5, -0.4]])
    assert (field.density(wall) < 1).all()
    assert (planning_field(field, UnknownSpace.OCCUPIED).density(wall) > 5).all()
    assert (planning_field(field, UnknownSpace.FREE).density(wall) < 1).all()
    assert field.evidence is not None and (field.evidence == Occupancy.SOLID).any()


def test_rays_that_show_nothing_but_the_sky_prove_their_way():
    field = rooms.field_without_the_plain_wall()
    empty = replace(field, values=torch.where(torch.tensor([True, False, False, False]), -20.0, field.values))
    taken = rooms.photographs(12).without_depth()
    sky = torch.tensor([178, 204, 230], dtype=torch.uint8).expand_as(taken.images).contiguous()
    assert share(carve_free_space(empty, replace(taken, images=sky)), AWAY > 2 * rooms.VOXEL) > 0.9
    grey = torch.full_like(sky, 128)
    assert not carve_free_space(empty, replace(taken, images=grey)).any()


def test_the_pictures_own_noise_is_found_whatever_they_show():
    taken = rooms.photographs(6, size=96).without_depth()
    assert estimate_noise(taken) < 0.5
    assert estimate_noise(noisy(taken, 5.0)) == pytest.approx(5, rel=0.3)
