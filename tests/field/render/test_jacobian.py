"""Colours of rays and their derivatives by the camera's motion."""

import pytest
import torch
from torch import Tensor

from nerfnav.field.models.analytic import BallsField
from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.render.jacobian import FastJacobian, colors_and_jacobian
from nerfnav.field.render.volume_rendering import render_rays
from nerfnav.geometry import so3
from nerfnav.geometry.box import Box
from nerfnav.geometry.camera import Camera, look_at

BOX = Box.of((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5))
CAMERA = Camera.from_fov(9, 7, 60)


def cloud() -> VoxelField:
    """A soft coloured ball, so that rays see through some of it."""
    axis = torch.linspace(-0.5, 0.5, 17)
    x, y, z = torch.meshgrid(axis, axis, axis, indexing="ij")
    raw = 6 * (0.25 - (x.square() + y.square() + z.square()).sqrt()) - 3.5
    colors = torch.stack([0.5 + 0.4 * torch.sin(7 * x), 0.5 + 0.4 * torch.sin(6 * y), 0.5 + 0.4 * torch.cos(5 * z)], -1)
    return VoxelField(BOX, torch.cat([raw[..., None], colors], -1), torch.tensor([0.2, 0.4, 0.6]))


def rays() -> tuple[Tensor, Tensor]:
    return CAMERA.rays(look_at(torch.tensor([0.9, 0.3, 0.4]), torch.tensor([0.05, -0.02, 0.01])))


class Plain:
    """A field without its fast paths."""

    def __init__(self, field: VoxelField) -> None:
        self.box, self.background, self.resolution = field.box, field.background, field.resolution
        self.density, self.radiance, self.samples = field.density, field.radiance, field.samples


def test_the_kernel_agrees_with_autograd():
    field = cloud()
    plain = Plain(field)
    assert isinstance(field, FastJacobian) and not isinstance(plain, FastJacobian)
    colors, jacobian = colors_and_jacobian(field, *rays())
    expected_colors, expected = colors_and_jacobian(plain, *rays())
    torch.testing.assert_close(colors, expected_colors, atol=2e-3, rtol=0)
    assert (jacobian - expected).norm() < 0.01 * expected.norm()
    assert expected.abs().max() > 0.3


@pytest.mark.parametrize("axis", range(6))
def test_derivatives_by_the_cameras_motion_are_those_of_finite_differences(axis: int):
    balls = BallsField(BOX, torch.tensor([[0.0, 0.0, 0.0]]).double(), torch.tensor([0.3]).double(), 0.05, 0.02)
    origins, directions = (part.double() for part in rays())
    _, jacobian = colors_and_jacobian(balls, origins, directions)
    samples, h = balls.samples(origins, directions), 1e-6

    def moved(by: float) -> Tensor:
        motion = torch.zeros(6, dtype=torch.float64)
        motion[axis] = by
        turned = directions @ so3.exp(motion[3:]).T
        return render_rays(balls, origins + motion[:3], turned, samples).color

    difference = (moved(h) - moved(-h)) / (2 * h)
    torch.testing.assert_close(jacobian[..., axis].double(), difference, atol=1e-4, rtol=1e-3)


def test_rays_that_meet_nothing_show_the_background_and_do_not_change():
    field = cloud()
    origins = torch.tensor([[2.0, 2.0, 2.0]])
    colors, jacobian = field.colors_and_jacobian(origins, torch.tensor([[1.0, 0.0, 0.0]]))
    torch.testing.assert_close(colors[0], field.background)
    assert jacobian.abs().max() == 0
