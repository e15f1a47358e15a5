"""Lenses: which way a pixel of a distorted picture looks."""

import cv2
import numpy as np
import pytest
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry.camera import Camera
from nerfnav.geometry.lens import distorted, undistorted

LENSES = [(-0.28, 0.07, 1e-3, -5e-4), (-0.28, 0.07, 1e-3, -5e-4, -0.001), (0.1, -0.05, -2e-3, 2e-3, 0.02)]


def camera(distortion: tuple[float, ...]) -> Camera:
    return Camera(120, 90, 80.0, 82.0, 61.0, 44.0, distortion)


@pytest.mark.parametrize("lens", LENSES)
def test_pixels_look_where_opencv_says(lens: tuple[float, ...]):
    seen = camera(lens)
    pixels = seen.pixels()
    matrix = np.array([[80.0, 0, 61.0], [0, 82.0, 44.0], [0, 0, 1]])
    centres = (pixels.double().numpy() + 0.5)[:, None]
    thorough = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 100, 1e-12)
    flat = cv2.undistortPoints(centres, matrix, np.array(lens), criteria=thorough)[:, 0]
    directions = seen.directions(pixels)
    found = directions[:, :2] / -directions[:, 2:]
    np.testing.assert_allclose(found[:, 0], flat[:, 0], atol=2e-5)
    np.testing.assert_allclose(-found[:, 1], flat[:, 1], atol=2e-5)


@pytest.mark.parametrize("lens", LENSES)
def test_distorting_what_was_undistorted_gives_it_back(lens: tuple[float, ...]):
    points = 1.2 * torch.rand(100, 2, generator=torch.Generator().manual_seed(0)).double() - 0.6
    torch.testing.assert_close(distorted(undistorted(points, lens), lens), points, atol=1e-9, rtol=0)


def test_distortion_is_that_of_opencvs_projection():
    points = np.array([[0.3, -0.2], [0.5, 0.4], [-0.6, 0.1]])
    still = np.zeros(3)
    expected = cv2.projectPoints(np.c_[points, np.ones(3)], still, still, np.eye(3), np.array(LENSES[1]))[0][:, 0]
    np.testing.assert_allclose(distorted(torch.from_numpy(points), LENSES[1]).numpy(), expected, atol=1e-12)


def test_a_smaller_picture_keeps_its_lens():
    seen = camera(LENSES[0])
    large, small = seen.directions(torch.tensor([[1, 1]])), seen.scaled(1 / 3).directions(torch.tensor([[0, 0]]))
    torch.testing.assert_close(large, small)


def test_a_lens_that_folds_the_picture_is_refused():
    with pytest.raises(InvalidInputError, match="cannot be undone"):
        camera((-0.8, 0.0, 0.0, 0.0)).directions(torch.tensor([[0, 0]]))


@pytest.mark.parametrize("lens", [(0.1,), (0.1, 0.0, 0.0, float("nan")), (0.1,) * 8])
def test_a_distortion_of_another_model_is_refused(lens: tuple[float, ...]):
    with pytest.raises(InvalidInputError, match="k1, k2, p1, p2 and perhaps k3"):
        camera(lens)
