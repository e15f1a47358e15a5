"""The voxel field's compiled paths against its torch paths, and those against finite differences."""

import numpy as np
import pytest
import torch

from nerfnav.field.core.occupancy import EMPTY_RAW
from nerfnav.field.core.protocol import density_and_gradient, density_at, density_in_box, uniform_samples
from nerfnav.field.models.voxel import VoxelField, occupied_blocks
from nerfnav.field.render.volume_rendering import render_rays
from nerfnav.geometry import Box, node_positions
from tests.field.fields import BOX, ball, random_rays, random_voxels


def test_compiled_rendering_equals_the_reference_to_1e_4():
    field = random_voxels()
    rays = random_rays(300)
    reference = render_rays(field, *rays, uniform_samples(BOX, *rays, field.step))
    compiled = field.render_rays(*rays)
    assert (compiled.color - reference.color).abs().max() < 1e-4
    assert (compiled.opacity - reference.opacity).abs().max() < 1e-4
    assert (compiled.depth - reference.depth).abs().max() < 1e-3


def test_skipping_empty_blocks_changes_no_colour():
    field = random_voxels()
    field.values[:12, :, :, 0] = EMPTY_RAW
    rays = random_rays(300, seed=1)
    assert 0 < int((~field.occupied).sum()) < field.occupied.numel()
    reference = render_rays(field, *rays, uniform_samples(BOX, *rays, field.step))
    assert (field.render_rays(*rays).color - reference.color).abs().max() < 1e-4


def test_the_fields_own_samples_give_the_reference_colour():
    field = random_voxels()
    rays = random_rays(300, seed=2)
    reference = render_rays(field, *rays, uniform_samples(BOX, *rays, field.step))
    assert (render_rays(field, *rays).color - reference.color).abs().max() < 1e-3


def test_the_border_of_the_box_belongs_to_it_however_coordinates_are_rounded():
    beyond = 0
    for lower, upper in np.random.default_rng(0).uniform((-9, 0.1), (0, 9), (20, 2)):
        box = Box(torch.full((3,), float(lower)), torch.full((3,), float(upper)))
        field = VoxelField(box, torch.full((4, 4, 4, 4), 0.5), torch.zeros(3))
        nodes = node_positions(box, (5, 5, 5)).reshape(-1, 3).double().numpy() * (1 + 1e-7)
        beyond += (density_at(field, nodes) == 0).sum()
        assert density_in_box(field, nodes) == pytest.approx(density_in_box(field, nodes[:1])[0])
        assert density_in_box(field, nodes[:1]) > 0
    assert beyond, "no coordinate was rounded outwards"


@pytest.mark.parametrize("count", [500, 30_000])  # one thread, all threads
def test_compiled_density_and_gradient_equal_autograd(count: int):
    single = random_voxels()
    field = VoxelField(BOX, single.values.double(), single.background.double())
    points = torch.rand(count, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(0)) * 3 - 1.5
    points.requires_grad_()
    density = field.density(points)
    (gradient,) = torch.autograd.grad(density.sum(), points)
    compiled, compiled_gradient = density_and_gradient(single, points.detach().numpy())
    assert 0 < int((density == 0).sum()) < count  # some lie outside the box
    torch.testing.assert_close(torch.from_numpy(compiled), density.detach(), rtol=1e-5, atol=1e-5)
    torch.testing.assert_close(torch.from_numpy(compiled_gradient), gradient, rtol=1e-4, atol=1e-3)


def test_fields_without_a_kernel_have_their_gradient_from_autograd():
    points = np.array([[0.29, 0.02, 0.01], [0.9, 0.9, 0.5]])
    density, gradient = density_and_gradient(ball(), points)
    step = 1e-6
    for axis in range(3):
        offset = step * np.eye(3)[axis]
        ahead, behind = (density_and_gradient(ball(), points + sign * offset)[0] for sign in (1, -1))
        np.testing.assert_allclose(gradient[:, axis], (ahead - behind) / (2 * step), rtol=1e-4, atol=1e-6)
    assert density[0] > 50 > density[1]


def test_density_is_differentiable_twice():
    field = random_voxels(dtype=torch.float64)
    point = torch.tensor([0.123, -0.234, 0.2], dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradgradcheck(lambda p: field.density(p), (point,))


def test_a_block_is_occupied_when_any_of_its_corners_is():
    raw = torch.full((9, 9, 9), EMPTY_RAW)
    raw[4, 0, 0] = 0.0
    blocks = occupied_blocks(raw, EMPTY_RAW + 1)
    assert blocks.shape == (3, 3, 3)
    assert blocks.nonzero().tolist() == [[0, 0, 0], [1, 0, 0]]  # node 4 borders cells of both
