"""Calibration: errors of a filter against the covariances that it claims."""

from collections.abc import Generator
from dataclasses import dataclass, replace

import numpy as np
import pytest
import torch
from torch import Tensor

from nerfnav.core.deadline import Deadline
from nerfnav.estimator.calibration import calibrate_filter, fit_calibration
from nerfnav.estimator.core.belief import Belief
from nerfnav.estimator.core.filter_config import FastConfig
from nerfnav.estimator.core.filter_step import FilterOutcome, FilterResult, FilterStep
from nerfnav.field import FieldInfo
from nerfnav.geometry import FORWARD_MOUNT, Pose, PosedImages
from nerfnav.robots import ProcessNoise, RigidState, StateNoise
from nerfnav.robots.state import TANGENT
from tests.clock import Clock
from tests.estimator.places import CAMERA, HERE, draws

NOISE = StateNoise()
PRIOR = np.diag(np.repeat([0.02**2, 0.02**2], 3))


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [1.0, 9.0])
@pytest.mark.parametrize("floor", [0.0, 0.004])
def test_floor_and_ratio_are_found(ratio: float, floor: float) -> None:
    generator, count = np.random.default_rng(1), 1500
    deviations = generator.uniform(1e-3, 4e-3, (count, 6))
    known, told = np.linalg.inv(PRIOR), np.einsum("ni,ij->nij", deviations**-2, np.eye(6))
    real = np.linalg.inv(known + told / ratio) + floor**2 * np.eye(6)
    errors = np.einsum("nij,nj->ni", np.linalg.cholesky(real), generator.standard_normal((count, 6)))
    position, attitude, found = fit_calibration(errors, np.linalg.inv(known + told), PRIOR)
    assert ratio < found < 1.4 * ratio
    assert position == pytest.approx(floor, abs=1.5e-3) and attitude == pytest.approx(floor, abs=1.5e-3)


@dataclass
class Overconfident:
    """A corrector whose errors have so many times the deviation that it claims, and that fails every so often."""

    truth: RigidState
    claimed: float
    times: float
    fails: int
    count: int = 0
    trust_dynamics: bool = True

    def correct(
        self, prediction: Belief, image: Tensor | None, generator: torch.Generator, noise: ProcessNoise | None = None
    ) -> Generator[FilterStep, None, FilterResult]:
        self.count += 1
        failed = self.fails > 0 and self.count % self.fails == 0
        size = 5.0 if failed else self.times * self.claimed
        mean = self.truth.retract(size * torch.randn(TANGENT, generator=generator))
        step = FilterStep(0, mean, 0.0, 0.0, torch.zeros(1, 2, dtype=torch.long), torch.zeros(1))
        yield step
        return FilterResult(Belief(mean, self.claimed**2 * torch.eye(TANGENT)), FilterOutcome.UPDATED, step)


def pictures(count: int) -> PosedImages:
    camera = HERE.pose.compose(FORWARD_MOUNT)
    poses = Pose(camera.rotation.expand(count, 3, 3), camera.position.expand(count, 3))
    return PosedImages(torch.zeros(count, CAMERA.height, CAMERA.width, 3, dtype=torch.uint8), CAMERA, poses)


def test_failed_corrections_are_counted_and_do_not_widen_the_others() -> None:
    for fails, share in ((0, 0.0), (4, 0.25)):
        estimator = Overconfident(HERE, 0.002, 2.0, fails)
        found = calibrate_filter(estimator, pictures(40), NOISE, draws(1))
        assert found is not None and found.corrections == 40
        assert found.failed_share == pytest.approx(share, abs=0.03)
        assert found.position_floor_m < 0.005 and found.attitude_floor_rad < 0.005


@pytest.mark.parametrize(("seconds", "corrections"), [(30.0, 30), (2.0, 12), (1e3, 40)])
def test_calibration_ends_with_its_time_but_not_before_the_fewest_corrections(
    seconds: float, corrections: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    estimator, clock = Overconfident(HERE, 0.002, 1.0, 0), Clock(monkeypatch)
    clock.slow(estimator, "correct", lambda *_: 1.0)
    found = calibrate_filter(estimator, pictures(40), NOISE, draws(1), Deadline(seconds))
    assert found is not None and found.corrections == corrections


def test_too_few_pictures_give_no_calibration() -> None:
    assert calibrate_filter(Overconfident(HERE, 0.002, 1.0, 0), pictures(3), NOISE, draws(1)) is None


def test_where_all_fail_the_floor_is_the_prediction() -> None:
    found = calibrate_filter(Overconfident(HERE, 0.002, 1.0, 1), pictures(20), NOISE, draws(1))
    assert found is not None and found.failed_share == 1 and found.position_floor_m == NOISE.position_m


def test_a_trained_field_that_was_never_calibrated_is_widened() -> None:
    config, trained = FastConfig(), FieldInfo(noise_std=0.03)
    assert config.for_field(trained).color_noise.per_patch == 0.25
    assert config.for_field(FieldInfo(learned_from="mesh")).color_noise.per_patch == 0.25
    assert config.for_field(FieldInfo()).color_noise.per_patch == 1
    assert config.for_field(replace(trained, position_floor_m=0.001)).color_noise.per_patch == 1
    calibrated = replace(trained, information_ratio=2.0, position_floor_m=0.001, attitude_floor_rad=0.003)
    used = config.for_field(calibrated)
    assert (used.color_noise.per_patch, used.floor.position_m, used.floor.attitude_rad) == (0.5, 0.001, 0.003)
