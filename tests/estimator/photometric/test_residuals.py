"""The photometric term."""

import math

import torch

from nerfnav.estimator.photometric.residuals import (
    ColorNoise,
    FieldCamera,
    Observation,
    difference,
    inliers,
    photometric_cost,
)
from nerfnav.field.render.volume_rendering import render_rays
from nerfnav.geometry.camera import FORWARD_MOUNT
from tests.estimator.places import CAMERA, HERE, balls, picture
from tests.field.fields import random_voxels_in_a_room

NOISE = ColorNoise(std=0.02, alike=4.0, outlier_deviations=3.0)


def observation() -> Observation:
    return Observation.of(picture(balls(), HERE), CAMERA.pixels(), FieldCamera(balls(), CAMERA, FORWARD_MOUNT))


def test_nothing_differs_at_the_pose_of_the_picture():
    assert difference(observation().residual(HERE)).max() <= 0.5 / 255 + 1e-4


def test_the_picture_differs_from_elsewhere():
    moved = HERE.retract(torch.tensor([0.05, 0.05, 0.0] + [0.0] * 9))
    assert difference(observation().residual(moved)).mean() > 0.02


def test_the_compact_rendering_is_the_reference_rendering():
    seen = observation()
    color = render_rays(seen.field, *seen.rays(HERE)).color
    torch.testing.assert_close(seen.residual(HERE), color - seen.colors, atol=1e-6, rtol=0)


def test_a_room_beyond_the_box_shows_as_in_the_reference_rendering():
    room = random_voxels_in_a_room()
    seen = Observation.of(picture(room, HERE), CAMERA.pixels(), FieldCamera(room, CAMERA, FORWARD_MOUNT))
    origins, directions = seen.rays(HERE)
    assert room.backdrop(origins, directions) is not None
    color = render_rays(room, origins, directions).color
    torch.testing.assert_close(seen.residual(HERE), color - seen.colors, atol=1e-5, rtol=0)


def test_velocity_and_body_rate_do_not_show():
    tangent = torch.zeros(12, requires_grad=True)
    observation().residual(HERE.retract(tangent)).square().sum().backward()
    assert tangent.grad is not None
    assert tangent.grad[3:6].abs().max() == 0 and tangent.grad[9:].abs().max() == 0
    assert tangent.grad[:3].abs().max() > 0


def test_a_few_wild_pixels_are_outliers():
    residual = torch.full((100, 3), 0.01)
    residual[:7] = 0.6
    believed = inliers(residual, NOISE)
    assert not believed[:7].any() and believed[7:].all()


def test_noise_is_believed_even_where_all_else_agrees():
    residual = torch.zeros(100, 3)
    residual[0] = 2.9 * NOISE.std
    assert inliers(residual, NOISE).all()


def test_nothing_is_an_outlier_without_a_limit():
    residual = torch.rand(50, 3)
    assert inliers(residual, ColorNoise(outlier_deviations=math.inf)).all()


def test_outliers_cost_nothing_and_pull_nowhere():
    residual = torch.tensor([[0.1, 0.0, 0.0], [0.9, 0.9, 0.9]], requires_grad=True)
    cost = photometric_cost(residual, torch.tensor([True, False]), NOISE)
    cost.backward()
    assert residual.grad is not None and residual.grad[1].abs().max() == 0
    torch.testing.assert_close(cost.detach(), torch.tensor(0.1**2 / (4 * 0.02**2)))
