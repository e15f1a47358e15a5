"""What stands around the box: kernels against the torch reference, and that against geometry."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from nerfnav.core.steps import run_steps
from nerfnav.field.core.occupancy import EMPTY_RAW
from nerfnav.field.core.protocol import uniform_samples
from nerfnav.field.kernels import pose_descent
from nerfnav.field.models.bricks import convert_to_bricks
from nerfnav.field.models.grid_field import GridField
from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.render.jacobian import colors_and_jacobian, jacobian_by_autograd, probe_rays
from nerfnav.field.render.surroundings import Surroundings, uncontracted
from nerfnav.field.render.volume_rendering import render_rays
from nerfnav.field.storage.checkpoint import load_field, save_field
from nerfnav.field.train.config import TrainConfig
from nerfnav.field.train.loop import train
from nerfnav.geometry import so3
from nerfnav.geometry.box import Box
from nerfnav.geometry.camera import Camera, Pose, look_at
from nerfnav.geometry.images import PosedImages
from tests.field.fields import BOX, random_rays, random_voxels, random_voxels_in_a_room

SMALL = Box.of((-0.4, -0.4, -0.4), (0.4, 0.4, 0.4))


def smooth_room() -> VoxelField:
    """Voxels in a fog whose colour changes slowly, as surroundings of photographs do."""
    field, nodes = random_voxels_in_a_room(), 64
    u, v, w = torch.meshgrid(*[torch.linspace(-2, 2, nodes)] * 3, indexing="ij")
    raw = torch.sin(2 * u) + torch.cos(1.5 * v + w) - 4
    colors = torch.stack([0.5 + 0.4 * torch.sin(2 * part + 1) for part in (u, v, w)], -1)
    return replace(field, outside=Surroundings(torch.cat([raw[..., None], colors], -1)))


def test_compiled_surroundings_equal_the_reference():
    field, rays = random_voxels_in_a_room(), random_rays(300)
    reference = render_rays(field, *rays, uniform_samples(BOX, *rays, field.step))
    compiled = field.render_rays(*rays)
    assert (compiled.color - reference.color).abs().max() < 1e-4
    assert (compiled.opacity - reference.opacity).abs().max() < 1e-4
    assert ((compiled.depth - reference.depth).abs() / (1 + reference.depth)).max() < 1e-3


def test_descents_ask_shells_in_pairs_and_see_nearly_the_same():
    field, rays = smooth_room(), random_rays(400)
    whole, seen = field.render_rays(*rays), probe_rays(field, *rays)
    assert seen is not None
    assert 0 < (whole.color - seen.color).abs().mean() < 0.01
    assert seen.opacity.min() > 0.99 and field.ray_grid[7][2] == 2
    color, opacity, _ = pose_descent.probe(field.exact_ray_grid, *(part.numpy() for part in rays))
    for mine, theirs in ((color, whole.color), (opacity, whole.opacity)):
        torch.testing.assert_close(torch.from_numpy(mine), theirs, rtol=0, atol=5e-4)
    colors, _ = pose_descent.colors_and_jacobian(field.ray_grid, *(part.numpy() for part in rays))
    torch.testing.assert_close(torch.from_numpy(colors), seen.color, rtol=0, atol=1e-4)


def test_an_odd_number_of_shells_is_asked_in_pairs_too():
    field = random_voxels_in_a_room()
    assert field.outside is not None
    odd = replace(field, outside=Surroundings(field.outside.values[:10, :10, :10].contiguous()))
    assert odd.outside is not None and odd.outside.shells == 5
    seen = probe_rays(odd, *random_rays(200))
    assert seen is not None and seen.opacity.min() > 0.99
    assert seen.depth.isfinite().all() and seen.color.isfinite().all()


def test_no_ray_ends_in_nothing():
    field, rays = random_voxels_in_a_room(), random_rays(300, seed=1)
    assert field.render_rays(*rays).opacity.min() > 0.9999
    assert random_voxels().render_rays(*rays).opacity.min() < 0.5


def test_shells_are_met_where_rays_leave_boxes_of_their_size():
    around = Surroundings(torch.zeros(16, 16, 16, 4))
    origins, directions = random_rays(50, seed=2)
    distance, contracted = around.crossings(BOX, origins, directions)
    points = origins[:, None] + distance[..., None] * directions[:, None]
    shell = ((points - BOX.center) / (0.5 * BOX.size)).abs().amax(-1)
    met = distance >= 0
    wanted = 8 / (8 - torch.arange(8) - 0.5)
    assert met[:, -1].all() and not met.all()
    torch.testing.assert_close(shell[met], wanted.expand_as(shell)[met], rtol=1e-4, atol=1e-4)
    assert (contracted[met].abs().amax(-1) <= 2).all()
    torch.testing.assert_close(uncontracted(BOX, contracted)[met], points[met], rtol=1e-3, atol=1e-3)


def test_density_stays_in_the_box():
    field = random_voxels_in_a_room()
    points = torch.rand(500, 3, generator=torch.Generator().manual_seed(0)) * 4 - 2
    assert torch.equal(field.density(points), random_voxels().density(points))


def test_colours_of_the_surroundings_are_differentiable_in_the_ray():
    field = random_voxels_in_a_room()
    field = replace(field, values=field.values.double(), outside=Surroundings(field.outside.values.double()))
    origin, direction = (part[:1].double() for part in random_rays(1, seed=3))

    def color(origin: torch.Tensor) -> torch.Tensor:
        seen = field.backdrop(origin, direction)
        assert seen is not None
        return seen.color

    assert torch.autograd.gradcheck(color, (origin.requires_grad_(),))


def test_surroundings_and_evidence_come_back_from_a_file(tmp_path: Path):
    field = random_voxels_in_a_room()
    evidence = torch.randint(3, field.shape, generator=torch.Generator().manual_seed(0), dtype=torch.uint8)
    save_field(replace(field, evidence=evidence), tmp_path / "field.npz")
    loaded = load_field(tmp_path / "field.npz")
    assert isinstance(loaded, VoxelField)
    assert loaded.evidence is not None and torch.equal(loaded.evidence, evidence)
    rays = random_rays(200)
    assert (loaded.render_rays(*rays).color - field.render_rays(*rays).color).abs().mean() < 0.01


def photographs_of_a_room(count: int, turn: float = 0.0) -> PosedImages:
    """Pictures, from within a small box, of far coloured walls with a pattern, in an otherwise empty world."""
    walls = torch.rand(40, 40, 40, 4, generator=torch.Generator().manual_seed(7))
    walls[..., 0] = EMPTY_RAW
    smooth = torch.nn.functional.avg_pool3d(walls[..., 1:].permute(3, 0, 1, 2), 7, 1, 3).permute(1, 2, 3, 0)
    walls[..., 1:] = ((smooth - 0.5) * 4 + 0.5).clamp(0, 1)
    world = VoxelField(SMALL, torch.full((3, 3, 3, 4), EMPTY_RAW), torch.zeros(3), outside=Surroundings(walls))
    camera, angles = Camera.from_fov(32, 32, 80), torch.arange(count) * 2.399963 + turn
    eyes = torch.stack([0.2 * angles.cos(), 0.2 * angles.sin(), 0.1 * (3 * angles).sin()], -1)
    poses = Pose.stack([look_at(eye, -eye + torch.tensor([0.0, 0.0, 0.05])) for eye in eyes])
    images = [
        (world.render_rays(*camera.rays(poses[k])).color.clamp(0, 1) * 255).round().to(torch.uint8).reshape(32, 32, 3)
        for k in range(count)
    ]
    return PosedImages(torch.stack(images), camera, poses)


@pytest.mark.slow
def test_far_walls_are_learned_as_surroundings_and_leave_the_box_clear():
    config = TrainConfig(voxel=0.04, iterations=300, rays=1024, outside=40)
    generator = torch.Generator().manual_seed(0)
    held_out = photographs_of_a_room(4, turn=0.3)
    field = run_steps(train(photographs_of_a_room(20), held_out, SMALL, torch.zeros(3), config, generator))
    assert field.outside is not None
    assert field.info.psnr_db is not None and field.info.psnr_db > 25
    points = torch.rand(2000, 3, generator=generator) * 0.6 - 0.3
    assert (field.density(points) < 1).float().mean() > 0.95


def test_a_camera_that_moves_sees_the_surroundings_move():
    field, (origins, directions) = random_voxels_in_a_room(), random_rays(30, seed=4)
    step = torch.tensor([1e-3, 0.0, 0.0])
    color, jacobian = colors_and_jacobian(field, origins, directions)
    ahead, behind = (field.render_rays(origins + sign * step, directions).color for sign in (1, -1))
    assert (color - field.render_rays(origins, directions).color).abs().max() < 1e-3
    # samples keep their distances in the derivative and jump in the difference: alike in most rays
    difference = ((ahead - behind) / 2e-3 - jacobian[:, :, 0]).abs().amax(-1)
    assert difference.median() < 0.05 * jacobian[:, :, 0].abs().max()


@pytest.mark.parametrize("kept", [lambda field: field, convert_to_bricks], ids=["dense", "in bricks"])
def test_compiled_derivatives_of_the_surroundings_are_those_of_autograd(kept: Callable[[VoxelField], GridField]):
    field, rays = random_voxels_in_a_room(), random_rays(300)
    colors, jacobian = colors_and_jacobian(kept(field), *rays)
    expected_colors, expected = jacobian_by_autograd(field, *rays)
    torch.testing.assert_close(colors, expected_colors, atol=1e-3, rtol=0)
    assert (jacobian - expected).norm() < 1e-3 * expected.norm()
    without = jacobian_by_autograd(replace(field, outside=None), *rays)[1]
    assert (jacobian - without).norm() > 0.3 * expected.norm()


@pytest.mark.parametrize("axis", range(6))
def test_derivatives_of_the_surroundings_are_those_of_finite_differences(axis: int):
    around = random_voxels_in_a_room().outside
    assert around is not None
    field = replace(random_voxels(), values=torch.full((9, 9, 9, 4), EMPTY_RAW), outside=around)
    origins, directions = random_rays(200, seed=5)
    _, jacobian = colors_and_jacobian(field, origins, directions)
    exact, box, h = Surroundings(around.values.double()), Box(BOX.lower.double(), BOX.upper.double()), 1e-7

    def seen(by: float) -> torch.Tensor:
        motion = torch.zeros(6, dtype=torch.float64)
        motion[axis] = by
        return exact.backdrop(box, origins + motion[:3], directions.double() @ so3.exp(motion[3:]).T).color

    difference = (seen(h) - seen(-h)) / (2 * h)
    close = (difference - jacobian[..., axis]).abs().amax(-1) < 1e-3 * difference.abs().max()
    assert close.float().mean() > 0.98  # in float32 a ray may be on the other side of a cell's border
