"""What a robot will know of its position along a plan, before it flies: as in flight, and reason enough not to."""

import math
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from nerfnav.core.steps import run_steps
from nerfnav.estimator import Belief, ColorNoise, ConsiderCovariance, FastFilter, FilterConfig
from nerfnav.estimator.core.prediction import predict
from nerfnav.estimator.photometric.pyramid import View
from nerfnav.field import VoxelField, render_image
from nerfnav.geometry import FORWARD_MOUNT, Pose, so3
from nerfnav.navigation.episode import Episode, EpisodeOutcome, NavigationStep
from nerfnav.navigation.expected_belief import expect_beliefs, expect_remainder, expect_sigma, explain_blindness
from nerfnav.navigation.flight import FlightContext, FlightRequest, NavigateConfig, NavigationStack
from nerfnav.navigation.loop import navigate
from nerfnav.navigation.simulator import Simulator
from nerfnav.planner import Route
from nerfnav.robots import Motion, Quadrotor, RigidState, StateNoise
from tests.estimator.places import CAMERA, COLOR_STD, balls, voxel_balls
from tests.navigation.doubles import StraightPlanner, draws

ROBOT = Quadrotor().with_camera(CAMERA, FORWARD_MOUNT)
START, GOAL = RigidState.at_rest((-0.6, 0.0, 0.3)), RigidState.at_rest((-0.3, 0.0, 0.3))
BACKWARD = Pose(so3.from_yaw(torch.tensor(math.pi)) @ FORWARD_MOUNT.rotation, FORWARD_MOUNT.position)
"""T_body_camera of a robot with its back to everything that is to be seen."""
NOISE = StateNoise(0.01, 0.005, 0.01, 0.005)
FILTER = FilterConfig(color_noise=ColorNoise(std=COLOR_STD), process_noise=NOISE)
CONFIG = NavigateConfig(FILTER, NOISE, NOISE)
EXACT = ConsiderCovariance()


def plan() -> Motion:
    return run_steps(StraightPlanner().plan(Route(START, GOAL, 20, 0.1))).motion


def flight(config: NavigateConfig = CONFIG, mount: Pose = FORWARD_MOUNT) -> FlightContext:
    field, robot = voxel_balls(), ROBOT.with_camera(CAMERA, mount)
    world = Simulator(robot, START, lambda pose: look(field, pose), draws(0), mount, noise=NOISE)
    estimator = FastFilter(field, robot, CAMERA, mount, FILTER)
    stack = NavigationStack(StraightPlanner(), estimator, camera_field=field)
    return FlightContext(FlightRequest(GOAL, 20, plan=plan()), world, stack, config, draws(1))


def fly(config: NavigateConfig, mount: Pose = FORWARD_MOUNT) -> list[NavigationStep]:
    context = flight(config, mount)
    events = navigate(context.request, context.simulator, context.stack, config, context.generator)
    return [event for event in events if isinstance(event, NavigationStep)]


def look(field: VoxelField, pose: Pose) -> torch.Tensor:
    return (255 * render_image(field, CAMERA, pose).color.clamp(0, 1)).round().to(torch.uint8)


def test_it_is_the_belief_of_a_flight_within_a_factor_of_two(tmp_path: Path) -> None:
    steps = fly(replace(CONFIG, in_sight=0.0))
    expected, flown = steps[0].expected_sigma, torch.tensor([step.belief.position_std for step in steps]).median()
    assert expected is not None and 0.5 < expected.median_m / flown < 2
    assert expected.median_m <= expected.p95_m <= expected.max_m and expected.blind_share == 0
    Episode.of(steps).save(tmp_path)
    assert Episode.load(tmp_path).expected_sigma == expected


def test_where_nothing_shows_it_is_that_of_the_prediction_alone() -> None:
    motion, view = plan(), View((voxel_balls(),), CAMERA, BACKWARD)
    config = replace(CONFIG, filter=replace(FILTER, floor=StateNoise(0.0, 0.0, 0.0, 0.0), grain=0.0))
    beliefs = run_steps(expect_beliefs(motion, ROBOT, view, config))
    belief = beliefs[0]
    for action in motion.actions:
        belief = predict(belief, action, ROBOT, motion.dt, NOISE)
    assert beliefs[-1].position_std == pytest.approx(belief.position_std, rel=0.01)
    assert (beliefs[-1].mean.position - GOAL.position).norm() < 1e-3


def test_gyroscopes_leave_less_to_expect() -> None:
    view = View((voxel_balls(),), CAMERA, BACKWARD)
    sigmas = [
        run_steps(expect_beliefs(plan(), ROBOT, view, replace(CONFIG, imu=imu)))[-1].position_std
        for imu in (False, True)
    ]
    assert sigmas[1] < 0.9 * sigmas[0]


def test_a_flight_with_too_little_to_see_is_refused_on_the_ground_with_the_share() -> None:
    blindly = replace(CONFIG, in_sight=0.0, most_blind=0.3)
    (refused,) = fly(blindly, BACKWARD)
    assert refused.outcome is EpisodeOutcome.TOO_RISKY
    assert refused.expected_sigma is not None and refused.expected_sigma.blind_share > 0.3
    assert len(fly(blindly)) > 1


@pytest.mark.slow
def test_a_robot_that_is_lost_for_want_of_something_to_see_was_warned_of_and_says_so() -> None:
    steps = fly(replace(CONFIG, in_sight=0.0), BACKWARD)
    told = Episode.of(steps).metrics()
    assert any(change["to"] == "lost" for change in told["transitions"])
    assert told["expected_sigma"]["blind_share"] > 0
    assert told["consistency"]["cause"] == "too_little_to_see"
    assert "too little to see: add texture" in told["consistency"]["sentence"]


def test_a_map_error_widens_it_and_does_not_blind() -> None:
    motion, numbers = plan(), (0.1**2 * torch.eye(6)).flatten().tolist()
    known, wrong = (
        expect_sigma(motion, ROBOT, voxel_balls(), CONFIG, error)
        for error in (EXACT, ConsiderCovariance(tuple(numbers)))
    )
    assert known is not None and wrong is not None
    assert wrong.median_m == pytest.approx((known.median_m**2 + 0.1**2) ** 0.5, rel=0.01)
    assert wrong.blind_share == known.blind_share == 0


def test_nothing_is_expected_blindly_of_a_broken_plan_or_of_a_field_that_only_the_reference_renders() -> None:
    motion = plan()
    broken = motion.map(lambda tensor: tensor * torch.nan)
    assert expect_sigma(motion, ROBOT, balls(), CONFIG, EXACT) is None
    assert expect_sigma(broken, ROBOT, voxel_balls(), CONFIG, EXACT) is None
    assert expect_sigma(motion, ROBOT, voxel_balls(), replace(CONFIG, open_loop=True), EXACT) is None


def test_the_sentence_has_the_share_and_the_remedy() -> None:
    assert explain_blindness(0.62).startswith("too little to see on 62 % of the way: add texture")
    assert "more than the 10 % that are accepted" in explain_blindness(0.62, 0.1)
    assert " on 1 % of the way" in explain_blindness(0.001)


def test_pictures_leave_little_variance_where_something_shows_and_all_of_it_elsewhere() -> None:
    left = expect_remainder(START, (), flight())
    assert left is not None and left[0] < 0.2 and left[len(left) // 2] == pytest.approx(1.0)


def test_a_heading_leaves_no_less_than_the_last_picture_from_nearby_did() -> None:
    widest = CONFIG.recovery.widest
    far = RigidState.at_rest((0.5, 0.0, 0.3))
    sure, wide = (StateNoise.isotropic((share * widest) ** 2).covariance() for share in (0.5, 2.0))

    def ahead(*views: Belief) -> float:
        left = expect_remainder(START, views, flight())
        assert left is not None
        return left[0]

    assert ahead() == ahead(Belief(far, wide)) < 0.2
    assert ahead(Belief(START, wide)) == 1
    assert ahead(Belief(START, wide), Belief(START, sure)) == pytest.approx(0.25), "the last one counts"
    assert ahead(Belief(START, 0.01 * sure)) == ahead()
