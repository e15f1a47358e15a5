"""What a picture is expected to tell: as its pixels say, nothing in the void."""

from dataclasses import replace

import torch

from nerfnav.estimator.core.filter_config import FastConfig
from nerfnav.estimator.gauss_newton.expected_information import expected_information
from nerfnav.estimator.photometric.pyramid import View
from nerfnav.estimator.photometric.residuals import ColorNoise
from nerfnav.geometry import FORWARD_MOUNT
from tests.estimator.places import CAMERA, COLOR_STD, HERE, draws, voxel_balls

CONFIG = FastConfig(color_noise=ColorNoise(std=COLOR_STD))
VIEW = View((voxel_balls(),), CAMERA, FORWARD_MOUNT)


def test_it_is_that_of_the_pixels_of_the_filter_whatever_the_size_of_the_picture() -> None:
    views = (VIEW, replace(VIEW, camera=CAMERA.scaled(4.0)))
    small, large = (expected_information(view, HERE.pose, 1e-4 * torch.eye(6), CONFIG, draws(0)) for view in views)
    assert torch.linalg.eigvalsh(small).min() > 0, "every number of the pose shows"
    assert 0.5 < large.trace() / small.trace() < 2


def test_a_picture_of_nothing_tells_nothing() -> None:
    away = replace(HERE.pose, position=torch.tensor([50.0, 0.0, 0.0]))
    assert not expected_information(VIEW, away, torch.eye(6), CONFIG, draws(0)).any()
