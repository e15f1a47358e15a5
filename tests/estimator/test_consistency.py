"""Consistency monitor: the size of the process noise is found, and a cause is named only where there is one."""

from dataclasses import replace

import pytest
import torch

from nerfnav.core.steps import run_steps
from nerfnav.estimator import Belief, Consistency, FastFilter, FilterConfig, update_consistently
from nerfnav.estimator.consistency import Cause
from nerfnav.estimator.core.filter_step import FilterOutcome, FilterResult, FilterStep, Innovation
from nerfnav.robots import CAMERA, Quadrotor, RigidState, StateNoise
from tests.estimator.places import HOVER, balls

DT = 0.1
RIGHT = Innovation(6.0, 6.0, residual=0.6, mean_square=1.0, exposure=0.5)


def result(innovation: Innovation | None) -> FilterResult:
    belief = Belief(RigidState.at_rest((0.0, 0.0, 0.0)), StateNoise().covariance())
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


@pytest.mark.parametrize(
    ("wrong", "cause"),
    [
        ({"exposure": 4.0}, Cause.EXPOSURE),
        ({"residual": 3.0, "mean_square": 9.0}, Cause.CAMERA_OR_FIELD),
        ({"mean_square": 6.0}, Cause.MOVED_SCENE),
    ],
)
def test_a_cause_is_named_after_some_pictures(wrong: dict[str, float], cause: Cause) -> None:
    assert after(Consistency(), [replace(RIGHT, **wrong)] * 5).cause is None
    monitor = after(Consistency(), [replace(RIGHT, **wrong)] * 20)
    assert monitor.cause is cause and monitor.numbers["cause"] == cause.name.lower()
    assert monitor.sentence is not None and "\n" not in monitor.sentence


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
