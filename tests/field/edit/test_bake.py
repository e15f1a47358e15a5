"""Baking: the voxel field stops as much light as the field that it was made of, and looks like it."""

import math

import pytest
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.core.steps import run_steps
from nerfnav.field.core.occupancy import DENSITY_SCALE, EMPTY_RAW
from nerfnav.field.edit.bake import BakeConfig, bake, fitted, likeness, moments, moments_of, refined, sample_views
from nerfnav.field.models.analytic import BallsField
from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.render.volume_rendering import render_rays
from nerfnav.geometry.box import Box
from nerfnav.geometry.camera import Camera
from tests.collected_steps import collect

BOX = Box.of((-0.5, -0.45, -0.4), (0.5, 0.45, 0.4))
BALLS = BallsField(BOX, torch.tensor([[-0.15, 0.0, 0.0], [0.2, 0.1, 0.05]]), torch.tensor([0.2, 0.15]))
SMALL = BakeConfig(voxel=0.02, views=4, size=40)


@pytest.fixture(scope="module")
def baked() -> VoxelField:
    steps, field = collect(bake(BALLS, SMALL))
    fractions = [step.fraction for step in steps]
    assert fractions == sorted(fractions) and fractions[-1] == 1
    return field


def test_moments_are_the_adjoint_of_refining_and_keep_constants() -> None:
    generator = torch.Generator().manual_seed(0)
    nodes, points = torch.rand(4, 5, 3, generator=generator), torch.rand(6, 8, 4, generator=generator)
    torch.testing.assert_close(moments(torch.full((6, 8, 4), 3.0)), torch.full((4, 5, 3), 3.0))
    x, y, z = (torch.cat([torch.ones(1), torch.full((count - 2,), 2.0), torch.ones(1)]) for count in nodes.shape)
    weights = x[:, None, None] * y[:, None] * z
    assert (refined(nodes) * points).sum() == pytest.approx((nodes * moments(points) * weights).sum().item(), rel=1e-5)


def test_the_kernel_is_its_twin_in_torch() -> None:
    raw = torch.rand(7, 6, 9, generator=torch.Generator().manual_seed(1)) * 12 - 10
    raw[2:4] = EMPTY_RAW
    reference = moments(DENSITY_SCALE * torch.nn.functional.softplus(refined(raw)))
    torch.testing.assert_close(moments_of(raw), reference, rtol=1e-4, atol=1e-4)


def test_fitting_meets_the_moments_of_a_grid() -> None:
    wanted = torch.rand(9, 9, 9, generator=torch.Generator().manual_seed(2)) * 4 - 6
    targets = moments_of(wanted)
    torch.testing.assert_close(moments_of(fitted(targets, 30, 0.01)), targets, rtol=0.02, atol=0.02)


def test_a_baked_field_looks_like_its_original(baked: VoxelField) -> None:
    psnr = baked.info.baked_psnr_db
    assert psnr is not None and psnr > 27
    views = sample_views(BOX, 3, BakeConfig.distance)
    assert likeness(BALLS, baked, views, Camera.from_fov(40, 40, 50)) > 26


def test_rays_lose_as_much_light_in_it(baked: VoxelField) -> None:
    # soft light: a thin fog instead of solid balls
    fog = BallsField(BOX, BALLS.centers, BALLS.radii, softness=0.05, peak=4.0)
    thin = run_steps(bake(fog, SMALL))
    side = torch.linspace(-0.3, 0.3, 13)
    origins = torch.stack([side, 0.4 * side, torch.full_like(side, 0.6)], -1)
    directions = torch.tensor([[0.0, 0, -1]]).expand(13, 3)
    own, mine = render_rays(fog, origins, directions), render_rays(thin, origins, directions)
    torch.testing.assert_close(mine.opacity, own.opacity, rtol=0, atol=0.02)
    solid = render_rays(baked, origins, directions).opacity
    torch.testing.assert_close(solid[5:8], torch.ones(3), rtol=0, atol=0.01)


def test_colours_that_depend_on_the_direction_become_their_mean_over_those_that_see_them() -> None:
    class Shiny(BallsField):
        """Red from above, blue from below."""

        def radiance(self, points: torch.Tensor, directions: torch.Tensor) -> torch.Tensor:
            share = 0.5 - 0.5 * directions[..., 2]
            return torch.stack([share, torch.zeros_like(share), 1 - share], -1)

    ball = Shiny(BOX, torch.zeros(1, 3), torch.tensor([0.25]))
    mean = run_steps(bake(ball, BakeConfig(voxel=0.025, views=1, size=8)))
    top, bottom = torch.tensor([[0.0, 0, 0.25]]), torch.tensor([[0.0, 0, -0.25]])
    down = torch.tensor([[0.0, 0, -1]])
    assert mean.radiance(top, down)[0, 0] > 0.65 > 0.35 > mean.radiance(bottom, down)[0, 0]


@pytest.mark.parametrize("voxel", [-0.1, 0.0, 1e-5, math.nan])
def test_impossible_voxels_are_refused(voxel: float) -> None:
    with pytest.raises(InvalidInputError, match="voxels"):
        next(bake(BALLS, BakeConfig(voxel=voxel)))


def test_a_grid_that_memory_cannot_hold_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("nerfnav.core.memory.available_memory", lambda: 10**6)
    with pytest.raises(InvalidInputError, match=r"voxels may take .* of memory are free: choose larger ones"):
        next(bake(BALLS, BakeConfig(voxel=0.02)))
