"""The paper's filter, from a picture to a posterior."""

from dataclasses import dataclass, replace
from typing import Any

import pytest
import torch
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.core.steps import run_steps
from nerfnav.estimator import Corrector, estimators
from nerfnav.estimator.core.belief import Belief, Curvature
from nerfnav.estimator.core.filter_config import DescentConfig, FilterConfig
from nerfnav.estimator.core.filter_step import FilterOutcome
from nerfnav.estimator.core.prediction import predict
from nerfnav.estimator.paper.pose_filter import PoseFilter
from nerfnav.estimator.photometric.pixel_selection import PixelConfig, PixelSource
from nerfnav.estimator.photometric.residuals import ColorNoise
from nerfnav.field import FieldInfo
from nerfnav.field.core.protocol import Points
from nerfnav.field.models.analytic import BallsField
from nerfnav.robots import StateNoise
from nerfnav.robots.state import RigidState
from tests.estimator.places import (
    BOX,
    CAMERA,
    COLOR_STD,
    DT,
    HERE,
    HOVER,
    ROBOT,
    Updated,
    balls,
    collect,
    draws,
    near,
    picture,
    updated,
)

SMALL = StateNoise(0.006, 0.003, 0.006, 0.003)
DESCENT = DescentConfig(90, position_rate=2e-3, velocity_rate=1e-3, attitude_rate=2e-3, body_rate_rate=1e-3)
CONFIG = FilterConfig(
    pixels=PixelConfig(count=120),
    descent=DESCENT,
    process_noise=SMALL,
    color_noise=ColorNoise(std=COLOR_STD, alike=1.0),
    retries=0,
)
FILTER = PoseFilter(balls(), ROBOT, CAMERA, config=CONFIG)


def update(seed: int, filter_: PoseFilter = FILTER) -> Updated:
    """One update of HERE's belief under SMALL noise, see `updated`."""
    return updated(filter_, SMALL, seed)


def test_a_picture_makes_the_pose_many_times_better():
    _, result, truth, prediction = update(0)
    before, after = prediction.mean.local(truth), result.posterior.mean.local(truth)
    assert after[:3].norm() < 0.3 * before[:3].norm()
    assert after[6:9].norm() < 0.5 * before[6:9].norm()
    assert result.outcome is FilterOutcome.UPDATED
    assert result.curvature is Curvature.EXACT


def test_every_iteration_is_yielded_and_the_last_step_has_the_posteriors_mean():
    steps, result, _, prediction = update(1)
    assert [step.iteration for step in steps] == [*range(DESCENT.iterations + 1), DESCENT.iterations]
    assert steps[-1] is result.step
    assert torch.equal(result.step.mean.position, result.posterior.mean.position)
    assert torch.equal(steps[0].mean.position, prediction.mean.position)
    assert steps[-1].photometric < steps[0].photometric


def test_steps_say_which_pixels_they_compare_and_how_they_differ():
    step = update(2)[0][-1]
    assert step.pixels.shape == (120, 2) and step.residual.shape == (120,)
    assert step.believed is not None and step.believed.float().mean() > 0.9
    assert step.pixel_source in (PixelSource.FEATURES, PixelSource.FILLED)


def test_the_covariance_is_honest():  # about five seconds, yet unmarked: each change must keep the filter consistent
    """Mean NEES of 12 updates: 12 is right, and chance alone stays within 7.6 and 17.5 in 998 of 1,000 cases."""
    nees = []
    for seed in range(12):
        _, result, truth, _ = update(100 + seed)
        belief = result.posterior
        error = belief.mean.local(truth)
        nees.append((error @ torch.linalg.solve(belief.covariance, error)).item())
    assert 7.6 < sum(nees) / len(nees) < 17.5


@pytest.mark.slow
def test_the_same_seed_gives_the_same_posterior():
    first, second = (update(3).result.posterior for _ in range(2))
    assert torch.equal(first.mean.position, second.mean.position)
    assert torch.equal(first.covariance, second.covariance)


def test_a_picture_without_contrast_leaves_the_prediction():
    black = torch.zeros(CAMERA.height, CAMERA.width, 3, dtype=torch.uint8)
    belief = near(HERE, 0)
    result = run_steps(FILTER.update(belief, black, HOVER, DT, draws(0)))
    assert result.outcome is FilterOutcome.PREDICTED_ONLY
    assert result.step.pixel_source is PixelSource.UNIFORM
    expected = predict(belief, HOVER, ROBOT, DT, SMALL)
    torch.testing.assert_close(result.posterior.covariance, expected.covariance)
    torch.testing.assert_close(result.posterior.mean.position, expected.mean.position)


@dataclass(frozen=True)
class BrokenField(BallsField):
    """A field whose colours are NaN beyond x = 0.3."""

    def radiance(self, points: Points, directions: Points) -> Points:
        """NaN far away."""
        color = super().radiance(points, directions)
        return torch.where(points[..., :1] > 0.3, torch.full_like(color, torch.nan), color)


def test_a_field_that_shows_nan_leaves_the_prediction():
    broken = BrokenField(BOX, balls().centers, balls().radii, step=0.03)
    result = update(0, replace(FILTER, field=broken)).result
    assert result.outcome is FilterOutcome.PREDICTED_ONLY
    assert result.posterior.mean.position.isfinite().all()


def test_a_picture_from_elsewhere_is_reported_as_diverged():
    belief, elsewhere = near(HERE, 0, SMALL), RigidState.at_rest((0.3, 0.3, 0.6), 2.5)
    step = run_steps(FILTER.update(belief, picture(balls(), elsewhere), HOVER, DT, draws(0)))
    assert step.outcome is FilterOutcome.DIVERGED
    assert step.posterior.covariance.isfinite().all()


@pytest.mark.slow
def test_a_false_minimum_is_left_by_trying_again():
    far = StateNoise(0.08, 0.01, 0.1, 0.01)
    coarse = replace(DESCENT, iterations=60, position_rate=5e-3, attitude_rate=5e-3)
    wide = replace(CONFIG, process_noise=far, descent=coarse)
    belief, truth = Belief(HERE.retract(far.sample(draws(11))), SMALL.covariance()), ROBOT.step(HERE, HOVER, DT)
    image = picture(balls(), truth)
    once = run_steps(replace(FILTER, config=wide).update(belief, image, HOVER, DT, draws(0)))
    patient = replace(FILTER, config=replace(wide, retries=3))
    more, found = collect(patient.update(belief, image, HOVER, DT, draws(0)))
    assert once.outcome is FilterOutcome.DIVERGED
    assert found.outcome is FilterOutcome.UPDATED
    assert found.posterior.mean.local(truth)[:3].norm() < 0.02
    assert [step.iteration for step in more[:-1]] == list(range(len(more) - 1))


def test_outliers_do_not_pull_the_pose():
    generator = draws(7)
    image = picture(balls(), HERE, generator)
    image[2:8, 3:9] = torch.tensor([255, 0, 255], dtype=torch.uint8)
    belief = near(HERE, 7, SMALL)
    result = run_steps(FILTER.update(belief, image, HOVER, DT, generator))
    truth, step = ROBOT.step(HERE, HOVER, DT), result.step
    assert result.posterior.mean.local(truth)[:3].norm() < 0.006
    assert step.believed is not None
    hidden = (step.pixels[:, 0] >= 3) & (step.pixels[:, 0] < 9) & (step.pixels[:, 1] >= 2) & (step.pixels[:, 1] < 8)
    assert hidden.sum() > 5 and step.believed[hidden].float().mean() < 0.2


@pytest.mark.parametrize(
    "image",
    [
        torch.zeros(10, 10, 3, dtype=torch.uint8),
        torch.zeros(CAMERA.height, CAMERA.width, 3),
        torch.zeros(CAMERA.height, CAMERA.width, dtype=torch.uint8),
    ],
)
def test_a_picture_of_another_camera_is_refused_before_any_work(image: Tensor):
    with pytest.raises(InvalidInputError, match="20 x 24 x 3"):
        FILTER.update(near(HERE, 0), image, HOVER, DT, draws(0))


def test_the_paper_preset_has_the_papers_numbers():
    paper = FilterConfig.paper()
    assert paper.descent.iterations == 300 and paper.descent.stop_change is None
    assert paper.pixels.count == 256 and paper.retries == 0
    torch.testing.assert_close(paper.process_noise.covariance(), 0.1 * torch.eye(12))


def test_what_was_measured_of_a_field_is_taken_over_where_it_is_known():
    assert FilterConfig().for_field(FieldInfo(noise_std=0.03)).color_noise.std == 0.03
    assert FilterConfig().for_field(FieldInfo()) == FilterConfig()
    measured, usual = FieldInfo(noise_std=0.03, position_floor_m=0.004), FilterConfig().floor
    known = FilterConfig(color_noise=ColorNoise(alike=7.0)).for_field(measured)
    assert known.color_noise == ColorNoise(std=0.03, alike=7.0)
    assert known.floor == replace(usual, position_m=0.004) and known.grain == 0


@pytest.mark.parametrize("asked", [{"floor": StateNoise(0.1, 0.2, 0.3, 0.4)}, {"grain": 0.2}, {"grain": 0.0}])
def test_a_floor_that_was_asked_for_is_kept(asked: dict[str, Any]):
    mine = FilterConfig(**asked)
    known = mine.for_field(FieldInfo(position_floor_m=0.004))
    assert (known.floor, known.grain) == (mine.floor, mine.grain)


def test_the_learning_rates_stand_where_their_numbers_stand():
    rates = DescentConfig(position_rate=1.0, velocity_rate=2.0, attitude_rate=3.0, body_rate_rate=4.0).rates()
    assert rates.tolist() == [1.0] * 3 + [2.0] * 3 + [3.0] * 3 + [4.0] * 3


@pytest.mark.parametrize("name", estimators.names())
def test_whatever_moves_a_belief_a_picture_corrects_it_the_same_way(name: str) -> None:
    quick = replace(CONFIG, descent=replace(DESCENT, iterations=5))
    estimator = estimators.load(name).make(balls(), ROBOT, CAMERA, config=quick)
    assert isinstance(estimator, Corrector)
    begun, seen = Belief(HERE, SMALL.covariance()), picture(balls(), HERE)
    updated_ = run_steps(estimator.update(begun, seen, HOVER, DT, draws(0)))
    moved = predict(begun, HOVER, ROBOT, DT, SMALL)
    corrected = run_steps(estimator.correct(moved, seen, draws(0), SMALL))
    assert updated_.posterior is not None and corrected.posterior is not None
    assert torch.equal(updated_.posterior.mean.position, corrected.posterior.mean.position)
    assert torch.equal(updated_.posterior.covariance, corrected.posterior.covariance)
    with pytest.raises(InvalidInputError, match="camera"):
        list(estimator.correct(moved, seen[:-1], draws(0)))
