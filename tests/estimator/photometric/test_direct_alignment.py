"""Direct alignment: its slopes, lenses, and where it leads."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
import torch

from nerfnav.estimator.photometric.direct_alignment import (
    AlignConfig,
    _lens,
    _scene,
    blur_picture,
    draw_spaced_pixels,
    fit_pose,
)
from nerfnav.estimator.photometric.kernels.direct_alignment import align
from nerfnav.estimator.photometric.levenberg_marquardt import Guess, Prior, join_information
from nerfnav.estimator.photometric.pyramid import View
from nerfnav.estimator.photometric.residuals import Observation
from nerfnav.field import build_levels
from nerfnav.field.render.volume_rendering import render_image
from nerfnav.geometry import so3
from nerfnav.geometry.camera import FORWARD_MOUNT, Camera, Pose
from tests.estimator.places import HERE, draws, voxel_balls

PINHOLE = Camera.from_fov(120, 96, 80)
LENS = replace(PINHOLE, distortion=(-0.12, 0.03, 0.002, -0.001))
MOUNT = replace(FORWARD_MOUNT, position=torch.tensor([0.05, 0.02, 0.03]))


def view(camera: Camera) -> View:
    return View(build_levels(voxel_balls(), 1), camera, MOUNT)


def picture(camera: Camera, body: Pose) -> torch.Tensor:
    color = render_image(voxel_balls(), camera, body.compose(MOUNT)).color
    return (255 * color.clamp(0, 1)).round().to(torch.uint8).reshape(camera.height, camera.width, 3)


def known(pixels: int) -> Prior:
    return Prior(join_information(None, (0.1, 0.05)), None, pixels / 0.02**2)


def off(moved: tuple[float, float, float], turned: tuple[float, float, float]) -> Pose:
    here = HERE.pose
    return Pose(so3.retract(here.rotation, torch.tensor(turned)), here.position + torch.tensor(moved))


@pytest.mark.parametrize("camera", [PINHOLE, LENS], ids=["pinhole", "lens"])
def test_the_slope_is_the_derivative_of_the_cost(camera: Camera) -> None:
    pixels = draw_spaced_pixels(camera, 400, draws(0))
    seen = Observation.of(picture(camera, HERE.pose), pixels, view(camera).at(0))
    scene, _ = _scene(seen, off((0.02, 0.01, 0.0), (0.0, 0.02, 0.01)))
    seen_picture = cv2.GaussianBlur(picture(camera, HERE.pose).numpy().astype(np.float32) / 255, (0, 0), 3.0)
    prior = (np.eye(8), np.eye(3), HERE.pose.position.double().numpy(), True, 30.0)

    def state(pose: Pose, exposure: tuple[float, float]) -> tuple[np.ndarray, ...]:
        shapes = ((3, 3), (3,), (2,), (), (), (len(pixels), 3), (8,), (8, 8), (8, 8), (8,))
        parts = tuple(np.zeros((2, *shape)) for shape in shapes)
        parts[0][0], parts[1][0], parts[2][0] = pose.rotation.numpy(), pose.position.numpy(), exposure
        align((seen_picture, *scene), prior, (0, 1e-3, 0.1, 0.1), parts)
        return parts

    at = off((0.02, 0.01, 0.01), (0.01, 0.02, 0.0))
    at = Pose(so3.project(at.rotation.double()), at.position.double())
    slope, step = state(at, (0.05, 0.02))[9][0], 1e-4
    for index in range(8):
        costs = []
        for sign in (1, -1):
            change = sign * step * torch.eye(8, dtype=torch.float64)[index]
            moved = Pose(so3.retract(at.rotation, change[3:6]), at.position + change[:3])
            costs.append(state(moved, (0.05 + float(change[6]), 0.02 + float(change[7])))[3][0])
        assert (costs[0] - costs[1]) / (4 * step) == pytest.approx(slope[index], rel=0.03, abs=0.01 * abs(slope).max())


def test_a_lens_is_linear_about_each_pixel() -> None:
    pixels = draw_spaced_pixels(LENS, 50, draws(0))
    flat, lens = _lens(LENS, pixels)
    beside, _ = _lens(LENS, pixels + torch.tensor([1, -1]))
    moved = (lens @ (beside - flat)[..., None])[..., 0]
    torch.testing.assert_close(moved, torch.tensor([1.0, -1.0]).double().expand_as(moved), rtol=0, atol=0.02)


@pytest.mark.parametrize("camera", [PINHOLE, LENS], ids=["pinhole", "lens"])
def test_a_picture_is_fitted_from_several_pixels_away(camera: Camera) -> None:
    start = off((0.03, -0.03, 0.02), (0.03, -0.03, 0.04))
    begun = Guess.at(start.map(lambda tensor: tensor[None]))
    image = picture(camera, HERE.pose)
    here, seen = fit_pose(image, view(camera), begun, 6.0, known, AlignConfig(), draws(1))
    found = here.guess.pose[0]
    assert (found.position - HERE.pose.position).norm() < 0.004
    assert so3.local(found.rotation, HERE.pose.rotation).norm() < 0.006
    assert len(seen.pixels) == pytest.approx(AlignConfig().last_pixels, rel=0.1)


def test_pixels_are_spread_evenly() -> None:
    pixels = draw_spaced_pixels(PINHOLE, 480, draws(0))
    assert 400 < len(pixels) <= 480 and (pixels >= 0).all() and (pixels < torch.tensor([120, 96])).all()
    quarters = (pixels // torch.tensor([60, 48])).unique(dim=0, return_counts=True)[1]
    assert len(quarters) == 4 and quarters.max() - quarters.min() < 30


@pytest.mark.parametrize("blur", [1.5, 5.9, 6.0, 8.0, 12.0, 16.0])
def test_wide_blurs_on_smaller_pictures_are_gaussian(blur: float) -> None:
    colors = np.zeros((93, 121, 3), np.float32)
    colors[:, 40:80] = 1.0
    colors[30:60, :, 1] = 0.7
    off = np.abs(blur_picture(colors, blur) - cv2.GaussianBlur(colors, (0, 0), blur))
    assert off.max() < (0.02 if blur >= 6 else 1e-6)
