"""Consistency monitor: the size of the process noise is found, and a cause is named only where there is one."""

import math
from dataclasses import dataclass, replace

import pytest
import torch

from nerfnav.core.steps import run_steps
from nerfnav.estimator import Belief, ColorNoise, Consistency, FastFilter, FilterConfig, update_consistently
from nerfnav.estimator.consistency import Cause
from nerfnav.estimator.core.filter_step import FilterOutcome, FilterResult, FilterStep, Innovation
from nerfnav.field import VoxelField, render_image
from nerfnav.field.models.analytic import BallsField
from nerfnav.field.models.levels import raw_of
from nerfnav.geometry import FORWARD_MOUNT, Camera
from nerfnav.geometry.grid import node_positions, shape_for
from nerfnav.robots import Quadrotor, RigidState, StateNoise
from tests.estimator.places import BOX, CAMERA, COLOR_STD, HERE, HOVER, balls, draws, voxel_balls

DT = 0.1
RIGHT = Innovation(6.0, 6.0, residual=0.6, mean_square=1.0, exposure=0.5)


def result(innovation: Innovation | None, position_m: float = 0.1) -> FilterResult:
    belief = Belief(RigidState.at_rest((0.0, 0.0, 0.0)), StateNoise(position_m=position_m).covariance())
    step = FilterStep(0, belief.mean, 0.0, 0.0, torch.zeros(0, 2, dtype=torch.long), torch.zeros(0))
    return FilterResult(belief, FilterOutcome.UPDATED, step, innovation=innovation)


def after(monitor: Consistency, innovations: list[Innovation]) -> Consistency:
    for innovation in innovations:
        monitor = monitor.after(result(innovation))
    return monitor


def flown(true: float, steps: int = 20, seed: int = 0) -> Consistency:
    """Monitor of a filter that sees the pose exactly, where Q's standard deviations should be `true` times as large."""
    monitor, draws = Consistency(), torch.Generator().manual_seed(seed)
    for _ in range(steps):
        square = (true / monitor.noise_factor * torch.randn(6, generator=draws)).square().sum().item()
        monitor = monitor.after(result(replace(RIGHT, square=square)))
    return monitor


@pytest.mark.parametrize("true", [1 / 8, 1 / 2, 2.0, 8.0])
def test_the_right_size_of_the_process_noise_is_found_in_20_pictures(true: float) -> None:
    for seed in range(20):
        monitor = flown(true, seed=seed)
        assert true / 1.7 < monitor.estimate < 1.7 * true
        named = monitor.cause is Cause.NOISE_MODEL
        assert named or true in (1 / 2, 2.0)
        assert not named or f"{monitor.estimate:.2g} times" in (monitor.sentence or "")


def test_a_right_noise_model_is_left_alone() -> None:
    monitors = [flown(1.0, steps, seed) for steps in (10, 20, 40) for seed in range(100)]
    assert all(monitor.noise_factor == 1 and monitor.cause is None for monitor in monitors)


def test_one_false_minimum_changes_little_and_a_picture_that_says_nothing_changes_nothing() -> None:
    monitor = after(Consistency(), [RIGHT] * 10)
    assert after(monitor, [replace(RIGHT, square=1e6)]).estimate < 1.5
    assert monitor.after(result(None)) == monitor
    assert after(monitor, [replace(RIGHT, square=0.0, determined=0.0)] * 5).estimate == monitor.estimate


@dataclass(frozen=True)
class World:
    """A world beside the field of voxel_balls, and the camera and the noise of the robot in it."""

    shown: VoxelField | None = None
    """What pictures show from the `since`-th on; before, and with None, the field."""
    since: int = 0
    camera: Camera = CAMERA
    """True camera."""
    gain: float = 1.0
    """Gain of the pictures."""
    kicks: float = 1.0
    """Factor on the noise."""
    start: RigidState = HERE


def sampled(field: BallsField, step: float) -> VoxelField:
    points = node_positions(BOX, shape_for(BOX, step))
    colors = field.radiance(points, torch.zeros_like(points))
    return VoxelField(BOX, torch.cat([raw_of(field.density(points))[..., None], colors], -1), field.background)


def moved() -> VoxelField:
    """The balls, one of them elsewhere."""
    centers = balls().centers.clone()
    centers[1] += torch.tensor([0.0, 0.12, 0.1])
    return sampled(replace(balls(), centers=centers), 0.03)


def follow(world: World, field: VoxelField, pictures: int = 20) -> Consistency:
    """Follow a hovering robot by its pictures."""
    draw, noise, monitor = draws(0), StateNoise(0.01, 0.005, 0.01, 0.005), Consistency()
    config = FilterConfig(color_noise=ColorNoise(std=COLOR_STD), process_noise=noise)
    estimator = FastFilter(field, Quadrotor(), CAMERA, config=config)
    truth, belief = world.start, Belief(world.start.retract(noise.sample(draw)), noise.covariance())
    for index in range(pictures):
        truth = Quadrotor().step(truth, HOVER, DT).retract(noise.scaled(world.kicks).sample(draw))
        shown = field if world.shown is None or index < world.since else world.shown
        color = render_image(shown, world.camera, truth.pose.compose(FORWARD_MOUNT)).color
        color = world.gain * (color + COLOR_STD * torch.randn(color.shape, generator=draw))
        image = (255 * color.clamp(0, 1)).round().to(torch.uint8)
        found = run_steps(update_consistently(estimator, belief, image, HOVER, DT, draw, monitor))
        monitor, belief = monitor.after(found), found.posterior
    return monitor


BEHIND = RigidState.at_rest((-0.6, 0.0, 0.3), math.pi)
"""With its back to everything that is to be seen."""


@pytest.mark.parametrize(
    ("world", "cause"),
    [
        (World(), None),
        (World(start=BEHIND), Cause.TOO_LITTLE_TO_SEE),
        (World(gain=0.6), Cause.EXPOSURE),
        (World(camera=Camera.from_fov(24, 20, 75)), Cause.CAMERA_OR_FIELD),
        (World(shown=moved()), Cause.MOVED_SCENE),
        (World(kicks=1 / 8), Cause.NOISE_MODEL),
    ],
)
def test_the_cause_is_the_one_that_holds(world: World, cause: Cause | None) -> None:
    monitor = follow(world, voxel_balls())
    assert monitor.cause is cause and monitor.numbers["cause"] == (None if cause is None else cause.name.lower())
    assert (monitor.sentence is None) is (cause is None)


def test_a_field_that_agreed_at_first_is_too_coarse_here() -> None:
    coarse = sampled(balls(), 0.12)
    assert follow(World(shown=voxel_balls()), coarse).cause is Cause.CAMERA_OR_FIELD
    assert follow(World(shown=voxel_balls(), since=8), coarse).cause is Cause.FIELD


def test_pictures_that_tell_little_say_nothing_of_the_noise_the_camera_and_the_scene() -> None:
    little = Innovation(square=0.03, determined=0.5, residual=2.0, mean_square=9.0, exposure=3.0)
    monitor = after(after(Consistency(), [RIGHT] * 10), [little] * 15)
    assert monitor.cause is Cause.TOO_LITTLE_TO_SEE
    assert monitor.estimate > 0.7 and monitor.residual < 1.2
    assert monitor.sentence is not None and f"left {100 * monitor.left:.0f} %" in monitor.sentence


def test_a_robot_that_is_sure_sees_enough() -> None:
    monitor, little = Consistency(), replace(RIGHT, determined=0.5)
    for _ in range(30):
        monitor = monitor.after(result(little, position_m=0.01))
    assert monitor.cause is not Cause.TOO_LITTLE_TO_SEE and monitor.left == 0
    assert after(monitor, [little] * 15).cause is Cause.TOO_LITTLE_TO_SEE


def test_the_noise_model_is_named_by_enough_evidence_only() -> None:
    def moved_by(factor: float, pictures: int, determined: float) -> Consistency:
        monitor = Consistency()
        for _ in range(pictures):
            square = determined * (factor / monitor.noise_factor) ** 2
            monitor = monitor.after(result(replace(RIGHT, square=square, determined=determined)))
        return monitor

    doubtful, few = moved_by(0.28, 60, 4.0), moved_by(0.05, 10, 3.5)
    assert doubtful.estimate < 1 / 3 and doubtful.cause is None, "a third may give as much"
    assert few.cause is None
    assert moved_by(0.2, 60, 4.0).cause is moved_by(4.5, 60, 4.0).cause is Cause.NOISE_MODEL


def test_what_a_robot_sees_that_may_be_anywhere_tells_of_what_it_sees_alone() -> None:
    wrong = result(replace(RIGHT, square=50.0, determined=1.0, residual=3.0, mean_square=9.0, exposure=4.0))
    monitor = after(Consistency(), [RIGHT] * 10)
    lost = monitor.after(wrong, placed=False)
    assert replace(lost, left=monitor.left) == monitor and lost.left > monitor.left


def test_a_prediction_holds_the_scaled_noise() -> None:
    estimator = FastFilter(balls(), Quadrotor(), CAMERA, config=FilterConfig())
    belief = Belief(RigidState.at_rest((-0.4, 0.0, 0.3)), StateNoise.isotropic(1e-8).covariance())
    wide = Consistency(observed=9 * 6.0)
    usual, scaled = (
        run_steps(update_consistently(estimator, belief, None, HOVER, DT, torch.Generator(), monitor)).posterior
        for monitor in (Consistency(), wide)
    )
    assert wide.noise_factor == 3
    torch.testing.assert_close(scaled.covariance - usual.covariance, 8 * StateNoise().covariance())
