"""Noise of flights in a place, as plans allow for it: wide where pictures tell little, the usual one elsewhere."""

import math
from dataclasses import replace

import pytest
import torch

from nerfnav.estimator import Belief, ColorNoise, FilterConfig
from nerfnav.estimator.core.belief import POSE, add_information, posterior_covariance
from nerfnav.estimator.core.prediction import predict
from nerfnav.estimator.gauss_newton.expected_information import expected_information
from nerfnav.estimator.paper.cost import precision
from nerfnav.estimator.photometric.pyramid import View
from nerfnav.field import Field
from nerfnav.geometry import FORWARD_MOUNT, Pose, so3
from nerfnav.navigation import NavigateConfig, build_safe_planner, expect_noise
from nerfnav.navigation.expected_noise import _settle
from nerfnav.planner import FastPlanConfig, FieldPlanner, OccupancyMap, planners
from nerfnav.planner.risk.tracking_error import relative_degrees, tracking_deviations
from nerfnav.robots import PAPER_NOISE, NoiseModel, Quadrotor, RigidState
from tests.estimator.places import CAMERA, COLOR_STD, balls, voxel_balls

ROBOT = Quadrotor().with_camera(CAMERA, FORWARD_MOUNT)
PLAIN = 5 * COLOR_STD
"""Noise of colours by which pictures of the balls tell as little as those of a grey room."""


def config(std: float = COLOR_STD) -> NavigateConfig:
    return NavigateConfig(FilterConfig(color_noise=ColorNoise(std=std)))


def occupancy(field: Field) -> OccupancyMap:
    return OccupancyMap.of(field, ROBOT.body)


def test_where_pictures_tell_enough_it_is_the_usual_noise() -> None:
    field = voxel_balls()
    assert expect_noise(field, occupancy(field), ROBOT, config()) == PAPER_NOISE


def test_where_pictures_tell_little_plans_allow_for_a_wider_estimate() -> None:
    field = voxel_balls()
    noise = expect_noise(field, occupancy(field), ROBOT, config(PLAIN))
    assert noise.process == PAPER_NOISE.process
    pairs = zip(noise.estimate.deviations, PAPER_NOISE.estimate.deviations, strict=True)
    assert all(wide >= usual for wide, usual in pairs)
    level, usual = (tracking_deviations(ROBOT, 0.1, each)[-1].level for each in (noise, PAPER_NOISE))
    assert level > 1.1 * usual
    assert expect_noise(field, occupancy(field), ROBOT, config(PLAIN)) == noise, "it depends on chance"
    planner, safety_filter = build_safe_planner(
        planners.load("fast"), field, occupancy(field), ROBOT, FastPlanConfig(), noise
    )
    assert isinstance(planner, FieldPlanner) and planner.noise == noise
    assert safety_filter is not None and safety_filter.noise == noise


def test_gyroscopes_leave_less_to_allow_for() -> None:
    field = voxel_balls()
    blind = replace(config(PLAIN), filter=replace(config(PLAIN).filter, least_contrast=10**6))  # no picture is used
    camera = expect_noise(field, occupancy(field), ROBOT, blind)
    measured = expect_noise(field, occupancy(field), ROBOT, replace(blind, imu=True))
    assert measured.estimate.attitude_rad < camera.estimate.attitude_rad
    assert measured.estimate.position_m < camera.estimate.position_m


@pytest.mark.parametrize("yaw", [0.0, 1.0, -2.5])
def test_the_covariance_is_that_of_a_filter_at_rest(yaw: float) -> None:
    view, known, draws = View((voxel_balls(),), CAMERA, FORWARD_MOUNT), config(PLAIN), torch.Generator()
    place, floor = torch.tensor([-0.6, 0.0, 0.3]), known.filter.floor_at(view.grain).covariance()
    by_state = relative_degrees(ROBOT, 0.1)[0].float()
    found = _settle(view, place, yaw, known.filter, by_state, known.noise, floor, draws.manual_seed(3))
    state = RigidState.at_rest(tuple(place.tolist()), yaw)
    pose = Pose(so3.from_yaw(torch.tensor(yaw)), place)
    belief, action = Belief(state, NoiseModel().estimate.covariance()), ROBOT.hold(state, 0.1)
    draws.manual_seed(3)
    for step in range(24):
        predicted = predict(belief, action, ROBOT, 0.1, known.noise).covariance
        if step % 12 == 0:
            information = expected_information(view, pose, predicted[POSE][:, POSE], known.filter, draws)
        hessian = 2 * add_information(torch.zeros(3), precision(predicted), information)
        belief = Belief(state, posterior_covariance(hessian, predicted)[0] + floor)
    expected, own = belief.covariance.diagonal(), found.diagonal()
    assert own[:3].sum().sqrt() == pytest.approx(expected[:3].sum().sqrt().item(), rel=0.05)
    assert own[3:6].sum().sqrt() == pytest.approx(expected[3:6].sum().sqrt().item(), rel=0.05)
    assert own[6:].sqrt().tolist() == pytest.approx(expected[6:].sqrt().tolist(), rel=0.05)


def test_it_is_the_usual_noise_where_nothing_can_be_expected() -> None:
    field = voxel_balls()
    full = occupancy(field)
    full = replace(full, by_heading=torch.ones_like(full.by_heading))
    assert expect_noise(field, full, ROBOT, config(PLAIN)) == PAPER_NOISE, "there is no free place"
    analytic = balls()
    assert expect_noise(analytic, occupancy(analytic), ROBOT, config(PLAIN)) == PAPER_NOISE
    blind = replace(config(PLAIN), open_loop=True)
    assert expect_noise(field, occupancy(field), ROBOT, blind) == PAPER_NOISE
    assert math.isclose(PAPER_NOISE.estimate.position_m, 0.005)
