"""Finding a camera from nothing."""

from dataclasses import replace
from functools import cache

import pytest
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.core.steps import run_steps
from nerfnav.estimator.core.belief import POSE
from nerfnav.estimator.photometric.residuals import ColorNoise
from nerfnav.estimator.relocalize.global_localization import (
    RelocaliseConfig,
    RelocaliseOutcome,
    RelocaliseResult,
    RelocaliseStep,
    judge,
    select_distinct,
)
from nerfnav.estimator.relocalize.localizer import GlobalLocalizer
from nerfnav.estimator.relocalize.panorama import PanoramaConfig, PanoramaIndex
from nerfnav.geometry import so3
from nerfnav.geometry.camera import FORWARD_MOUNT, Camera, Pose
from nerfnav.robots import BODY_RATE, VELOCITY
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


def test_the_covariance_of_a_found_pose_holds_its_error() -> None:
    last = run_steps(searcher().relocalise(picture(voxel_balls(), TRUTH, draws(0))))
    state = TRUTH.moved_to(last.step.body_poses()[0])
    covariance = last.state_covariance()
    error = state.local(TRUTH)[POSE].double()
    nees = error @ torch.linalg.solve(covariance[POSE][:, POSE].double(), error)
    assert nees < 17, "chi-squared of six numbers is above 16.8 once in 100"
    assert covariance[POSE][:, POSE].diagonal().sqrt().max() < 0.02
    assert not covariance[VELOCITY].any() and not covariance[BODY_RATE].any()


def test_a_place_that_looks_like_another_is_ambiguous() -> None:
    step = RelocaliseStep(1.0, TRUTH.pose.map(lambda part: part.expand(2, *part.shape)), torch.tensor([1.0, 0.0]),
                          COLOR_STD * torch.tensor([1.0, 1.3]))  # fmt: skip
    covariance = torch.diag(torch.tensor([1e-4] * 6))
    assert judge(step, covariance, NOISE, CONFIG) is RelocaliseOutcome.AMBIGUOUS
    apart = replace(step, differences=COLOR_STD * torch.tensor([1.0, 2.0]))
    assert judge(apart, covariance, NOISE, CONFIG) is RelocaliseOutcome.FOUND
    assert judge(apart, 25 * covariance, NOISE, CONFIG) is RelocaliseOutcome.AMBIGUOUS, "the pose is vague"
    outliers = replace(CONFIG, core_std=0.1 * COLOR_STD)
    assert judge(apart, covariance, NOISE, outliers) is RelocaliseOutcome.LOST, "the field has its noise from outliers"
    assert judge(apart, covariance, NOISE, replace(outliers, core_std=0.0)) is RelocaliseOutcome.FOUND


def test_the_covariance_of_a_camera_off_the_bodys_middle_grows_with_its_lever() -> None:
    mount = Pose(FORWARD_MOUNT.rotation, torch.tensor([0.5, 0.0, 0.0]))
    step = RelocaliseStep(1.0, TRUTH.pose.compose(mount).map(lambda part: part[None]), torch.ones(1), torch.zeros(1))
    turned = torch.diag(torch.tensor([0.0, 0.0, 0.0, 1e-4, 1e-4, 1e-4]))
    state = RelocaliseResult(RelocaliseOutcome.FOUND, step, turned).state_covariance(mount)
    assert torch.allclose(state[POSE][:, POSE].diagonal()[3:], torch.full((3,), 1e-4))
    assert state[:3, :3].trace().item() == pytest.approx(2 * 0.5**2 * 1e-4, rel=1e-4), "a turn moves the body sideways"
