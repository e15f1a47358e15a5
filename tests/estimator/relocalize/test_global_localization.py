"""Finding a camera from nothing."""

from functools import cache

import pytest
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.core.steps import run_steps
from nerfnav.estimator.photometric.residuals import ColorNoise
from nerfnav.estimator.relocalize.global_localization import RelocaliseConfig, RelocaliseOutcome, select_distinct
from nerfnav.estimator.relocalize.localizer import GlobalLocalizer
from nerfnav.estimator.relocalize.panorama import PanoramaConfig, PanoramaIndex
from nerfnav.geometry import so3
from nerfnav.geometry.camera import FORWARD_MOUNT, Camera, Pose
from nerfnav.robots.state import RigidState
from tests.estimator.places import CAMERA, COLOR_STD, collect, draws, picture, voxel_balls

CONFIG = RelocaliseConfig(
    PanoramaConfig(spacing=0.12, levels=2), halvings=(1, 0), kept=(24, 3), iterations=(8, 12), robust=(0.2, 0.15)
)
NOISE = ColorNoise(std=COLOR_STD)
TRUTH = RigidState.at_rest((-0.35, 0.05, 0.28), 0.1)


@cache
def searcher() -> GlobalLocalizer:
    """Looks around once for all tests."""
    return GlobalLocalizer(voxel_balls(), CAMERA, NOISE, CONFIG)


def test_a_camera_is_found_from_its_picture_alone() -> None:
    steps, last = collect(searcher().relocalise(picture(voxel_balls(), TRUTH, draws(0))))
    assert [step.fraction for step in steps] == [0, pytest.approx(1 / 6), 1] and steps[-1] is last.step
    assert last.outcome is RelocaliseOutcome.FOUND
    assert (last.step.body_poses(FORWARD_MOUNT).position[0] - TRUTH.position).norm() < 0.02
    assert float(last.step.weights.sum()) == pytest.approx(1)


def test_a_tilted_camera_with_another_exposure_is_found() -> None:
    tilted = RigidState.at_rest((-0.45, 0.1, 0.3), -0.2).retract(torch.tensor([0.0] * 6 + [0.2, 0.25, 0.0] + [0.0] * 3))
    darker = (0.9 * picture(voxel_balls(), tilted).float() + 5).round().to(torch.uint8)
    last = run_steps(searcher().relocalise(darker))
    found = last.step.body_poses()[0]
    assert last.outcome is RelocaliseOutcome.FOUND
    assert (found.position - tilted.position).norm() < 0.02
    assert so3.local(tilted.rotation, found.rotation).norm() < 0.05


def test_pictures_with_more_pixels_than_are_needed_are_made_smaller() -> None:
    camera = Camera.from_fov(600, 500, 90)
    looks = run_steps(PanoramaIndex.render(voxel_balls(), camera, TRUTH.position[None], CONFIG.looks))
    image = torch.arange(250).repeat_interleave(2).to(torch.uint8)[:, None, None].expand(500, 600, 3)
    small = looks.fitted(image)
    assert looks.view.camera == camera.scaled(0.5) and small.shape == (250, 300, 3)
    assert small[:, 0, 0].tolist() == list(range(250))


def test_a_picture_that_shows_nothing_is_never_taken_for_a_place() -> None:
    sky = (255 * voxel_balls().background).round().to(torch.uint8).expand(CAMERA.height, CAMERA.width, 3)
    last = run_steps(searcher().relocalise(sky.contiguous()))
    assert last.outcome is not RelocaliseOutcome.FOUND


def test_a_picture_of_another_place_is_not_found() -> None:
    noise = (255 * torch.rand(CAMERA.height, CAMERA.width, 3, generator=draws(3))).to(torch.uint8)
    last = run_steps(searcher().relocalise(noise))
    assert last.outcome is RelocaliseOutcome.LOST


def test_a_picture_of_another_size_is_refused() -> None:
    with pytest.raises(InvalidInputError):
        next(iter(searcher().relocalise(torch.zeros(5, 6, 3, dtype=torch.uint8))))


def test_poses_that_are_alike_count_once() -> None:
    yaw = torch.tensor([0.0, 0.05, 1.0])
    poses = Pose(so3.from_yaw(yaw), torch.tensor([[0.0, 0.0, 0.0], [0.01, 0.0, 0.0], [0.0, 0.0, 0.0]]))
    assert select_distinct(poses, torch.tensor([2.0, 1.0, 3.0]), (0.1, 0.2)).tolist() == [1, 2]


def test_a_field_without_free_places_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="no free place"):
        run_steps(PanoramaIndex.render(voxel_balls(), Camera.from_fov(8, 8, 90), torch.zeros(0, 3), CONFIG.looks))
