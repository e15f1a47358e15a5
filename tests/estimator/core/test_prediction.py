"""Sizes of noises that are adapted to what a picture shows."""

from dataclasses import replace

import pytest
import torch

from nerfnav.core.steps import run_steps
from nerfnav.estimator.core.belief import Belief
from nerfnav.estimator.core.filter_config import FilterConfig
from nerfnav.estimator.core.prediction import estimate_noise_scale, scale_process_noise
from nerfnav.estimator.gauss_newton.fast_filter import FastFilter
from nerfnav.robots import StateNoise
from tests.estimator.gauss_newton.test_fast_filter import CONFIG, PYRAMID, SMALL
from tests.estimator.places import CAMERA, COLOR_STD, DT, HERE, HOVER, ROBOT, draws, picture, voxel_balls

SEEN = 1e6 * torch.eye(6)
FILTER = FastFilter(voxel_balls(), ROBOT, CAMERA, config=CONFIG)


def scales(times: float, seen: torch.Tensor, trust: float = 3.0) -> torch.Tensor:
    """Of 400 innovations whose standard deviations are `times` as large as assumed."""
    noise = times * 0.02 * torch.randn(400, 6, generator=draws(0))
    return torch.tensor([estimate_noise_scale(change, torch.eye(6) / 0.02**2, seen, trust) for change in noise])


def test_noise_that_is_as_assumed_keeps_its_size_on_the_average():
    assert scales(1.0, SEEN).mean() == pytest.approx(1, abs=0.05)


def test_noise_twice_and_half_as_large_is_noticed_as_far_as_its_size_was_open():
    assert scales(2.0, SEEN, trust=0.01).mean() == pytest.approx(4, rel=0.1)
    assert scales(0.5, SEEN, trust=0.01).mean() == pytest.approx(0.25, rel=0.1)
    assert scales(2.0, SEEN).mean() == pytest.approx((3 + 4 * 6) / 9, rel=0.1)
    assert (scales(2.0, SEEN, trust=1e6) - 1).abs().max() < 1e-3


def test_a_picture_that_tells_nothing_leaves_the_noise_as_it_is():
    assert estimate_noise_scale(torch.zeros(6), torch.eye(6), torch.zeros(6, 6), 3.0) == 1


def test_only_the_noise_of_a_prediction_is_scaled():
    noise, before = SMALL.covariance(), 0.5 * torch.eye(12)
    scaled = scale_process_noise(Belief(HERE, before + noise), noise, 3.0)
    torch.testing.assert_close(scaled.covariance, before + 3 * noise)


def kicked(filter_: FastFilter, kick: float, grain: torch.Generator | None = None) -> Belief:
    """After an update in which the robot was kicked aside by so much [m], and saw that with `grain` or without."""
    truth = ROBOT.step(HERE, HOVER, DT).retract(kick * torch.eye(12)[1])
    image = picture(voxel_balls(), truth, grain)
    last = run_steps(filter_.update(Belief(HERE, SMALL.covariance()), image, HOVER, DT, draws(0)))
    return last.posterior


def test_a_robot_that_was_kicked_is_less_sure_of_its_velocity_and_as_sure_of_its_place():
    plain = replace(FILTER, config=replace(CONFIG, adaptive=False))
    calm, hard, unmoved = kicked(FILTER, 0.005), kicked(FILTER, 0.06), kicked(plain, 0.06)
    assert hard.covariance[4, 4] > 1.5 * calm.covariance[4, 4]
    assert hard.covariance[4, 4] > 1.2 * unmoved.covariance[4, 4]
    torch.testing.assert_close(hard.mean.position, unmoved.mean.position, atol=1e-5, rtol=0)


def test_a_picture_that_differs_more_than_promised_or_shows_little_tells_less():
    def variance(adaptive: bool, **colors: float) -> float:
        noise = replace(CONFIG.color_noise, **colors)
        filter_ = replace(FILTER, config=replace(CONFIG, color_noise=noise, adaptive=adaptive))
        return kicked(filter_, 0.0, draws(3)).covariance[0, 0].item()

    assert variance(True, few_patches=1e4) > 2 * variance(True)
    rise = [variance(True, few_patches=few) - variance(True, few_patches=0.1) for few in (100.0, 200.0)]
    assert rise[1] > 3 * rise[0], "by the square of the number of patches"
    assert variance(False, few_patches=1e4) == pytest.approx(variance(False))
    assert variance(True, std=0.8 * COLOR_STD) > 1.5 * variance(False, std=0.8 * COLOR_STD)
    assert variance(True, std=3 * COLOR_STD) == pytest.approx(variance(False, std=3 * COLOR_STD), rel=0.05)


def test_the_paper_knows_its_noises():
    assert FilterConfig().adaptive and not FilterConfig.paper().adaptive


def test_a_search_from_a_right_pose_ends_early_and_alike_for_equal_seeds():
    doubting = replace(CONFIG, pyramid=replace(PYRAMID, search=replace(PYRAMID.search, doubt=0.0)))
    filter_ = replace(FILTER, config=doubting)
    image, belief = picture(voxel_balls(), HERE), Belief(HERE, SMALL.covariance())
    once, again = ([*filter_.correct(belief, image, draws(1))] for _ in range(2))
    found = [*FILTER.correct(belief, image, draws(1))]
    assert len(found) < len(once) <= len(found) + 3  # two stages, or three where all are done, each told once
    assert [step.iteration for step in once[:-1]] == [*range(len(once) - 1)]
    assert torch.equal(once[-1].mean.position, again[-1].mean.position)
    torch.testing.assert_close(once[-1].mean.position, found[-1].mean.position, atol=1e-3, rtol=0)


def test_many_poses_are_compared_at_fewer_pixels_each():
    wide = Belief(HERE, StateNoise(0.1, 0.01, 0.1, 0.01).covariance())
    thrifty = replace(FILTER, config=replace(CONFIG, pyramid=replace(PYRAMID, rays=500, narrow=0.0)))
    few = [*thrifty.correct(wide, picture(voxel_balls(), HERE), draws(0))]
    starts, steps = PYRAMID.starts + 1, PYRAMID.thorough * PYRAMID.iterations[0] + 1
    assert len(few[0].pixels) <= 500 // steps and len(few[0].pixels) >= 500 // (starts * steps)
    assert len(few[-1].pixels) == CAMERA.width * CAMERA.height
