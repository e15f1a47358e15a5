"""The fast filter, from a picture to a posterior."""

from dataclasses import replace

import pytest
import torch
from torch import Tensor

from nerfnav.errors import InvalidInputError
from nerfnav.estimator.belief import Belief
from nerfnav.estimator.cost import PoseCost
from nerfnav.estimator.fast import FastFilter, inerf
from nerfnav.estimator.filter import FilterConfig
from nerfnav.estimator.noise import StateNoise
from nerfnav.estimator.photometric import ColorNoise, Observation, patches
from nerfnav.estimator.pixels import PixelDraw
from nerfnav.estimator.predict import predict
from nerfnav.estimator.pyramid import PyramidConfig, SearchConfig
from nerfnav.estimator.steps import FilterOutcome, FilterStep
from nerfnav.field.render import render_image
from nerfnav.geometry.camera import FORWARD_MOUNT, Camera
from nerfnav.robots.state import RigidState
from tests.estimator.places import CAMERA, COLOR_STD, DT, HERE, HOVER, ROBOT, balls, draws, picture, posterior, updated

SMALL = StateNoise(0.01, 0.01, 0.01, 0.01)
SEARCH = SearchConfig(candidates=12, starts=3, pixels=(60, 100), iterations=(2, 3, 8))
PYRAMID = PyramidConfig(
    halvings=(1, 0), robust=(0.5, 0.1), iterations=(4, 10), candidates=12, starts=3, search=SEARCH
)
CONFIG = FilterConfig(
    pyramid=PYRAMID, process_noise=SMALL, color_noise=ColorNoise(std=COLOR_STD, per_patch=10.0), gain_std=0, bias_std=0,
    floor=StateNoise(0.0, 0.0, 0.0, 0.0), grain=0.0,
)  # fmt: skip
FILTER = FastFilter(balls(), ROBOT, CAMERA, config=CONFIG)
SHAPE = (CAMERA.height, CAMERA.width, 3)


def update(seed: int, filter_: FastFilter = FILTER) -> tuple[list[FilterStep], RigidState, Belief]:
    """One update of HERE's belief under SMALL noise, see `updated`."""
    return updated(filter_, SMALL, seed)


def assert_sound(belief: Belief) -> None:
    """A covariance must always be symmetric and positive definite, and everything finite."""
    covariance = belief.covariance
    assert torch.equal(covariance, covariance.T) or torch.allclose(covariance, covariance.T, atol=1e-9)
    assert torch.linalg.eigvalsh(covariance.double()).min() > 0
    assert belief.mean.position.isfinite().all() and belief.mean.rotation.isfinite().all()


def test_a_picture_makes_the_pose_many_times_better():
    steps, truth, prediction = update(0)
    before, after = prediction.mean.local(truth), posterior(steps[-1]).mean.local(truth)
    assert steps[-1].outcome is FilterOutcome.UPDATED
    assert after[:3].norm() < 0.3 * before[:3].norm()
    assert after[6:9].norm() < 0.3 * before[6:9].norm()


def test_every_iteration_is_yielded_and_only_the_last_step_has_the_posterior():
    steps, _, _ = update(1)
    assert all(step.posterior is None and step.outcome is None for step in steps[:-1])
    assert steps[-1].posterior is not None
    numbers = [step.iteration for step in steps]
    assert numbers[:-1] == [*range(len(steps) - 1)] and numbers[-1] == numbers[-2]


def test_derivatives_of_what_a_body_sees_are_those_of_finite_differences():
    off_centre = replace(FORWARD_MOUNT, position=torch.tensor([0.05, 0.02, 0.03]))
    seen = Observation.of(picture(balls(), HERE), CAMERA.pixels()[::7], (balls(), CAMERA, off_centre))
    _, jacobian = seen.linearised(HERE.pose.map(lambda tensor: tensor[None]))
    samples, h = seen.samples(HERE), 1e-3
    for column, index in enumerate((0, 1, 2, 6, 7, 8)):
        step = torch.zeros(12)
        step[index] = h
        slope = (seen.residual(HERE.retract(step), samples) - seen.residual(HERE.retract(-step), samples)) / (2 * h)
        assert (jacobian[0, ..., column] - slope).norm() < 0.03 * slope.norm()


def test_velocity_moves_through_the_predictions_cross_covariance():
    steps, _, prediction = update(2, replace(FILTER, config=replace(CONFIG, adaptive=False)))
    last = posterior(steps[-1]).mean
    pose = [0, 1, 2, 6, 7, 8]
    change = prediction.mean.local(last)
    covariance = prediction.covariance
    expected = covariance[3:6][:, pose] @ torch.linalg.solve(covariance[pose][:, pose], change[pose])
    torch.testing.assert_close(change[3:6], expected, atol=1e-5, rtol=1e-3)


def test_the_exact_covariance_is_near_that_of_gauss_newton():
    quick = posterior(update(3)[0][-1]).covariance
    exact = posterior(update(3, replace(FILTER, config=replace(CONFIG, exact_covariance=True)))[0][-1]).covariance
    ratio = quick.diagonal()[:3].sqrt() / exact.diagonal()[:3].sqrt()
    assert ((ratio > 0.5) & (ratio < 2)).all()


def test_a_darker_picture_finds_the_same_place_when_exposure_is_estimated():
    filter_ = replace(FILTER, config=replace(CONFIG, gain_std=0.3, bias_std=0.1))
    truth = HERE.retract(torch.tensor([0.01, -0.01, 0.01, 0, 0, 0, 0.01, 0.01, -0.01, 0, 0, 0]))
    dark = (0.75 * picture(balls(), truth).float() + 12).round().to(torch.uint8)
    prediction = Belief(HERE, SMALL.covariance())
    *_, aware = filter_.correct(prediction, dark, draws(0))
    *_, blind = FILTER.correct(prediction, dark, draws(0))
    error = truth.local(aware.mean)[:3].norm()
    assert error < 2e-3 and error < truth.local(blind.mean)[:3].norm()


def test_inerf_ignores_the_prediction_once_it_has_started():
    steps, truth, prediction = update(4, inerf(balls(), ROBOT, CAMERA, config=CONFIG))
    last = posterior(steps[-1]).mean
    assert truth.local(last)[:3].norm() < 0.3 * truth.local(prediction.mean)[:3].norm()
    torch.testing.assert_close(last.velocity, prediction.mean.velocity)


def test_without_a_picture_the_dynamics_alone_move_the_belief():
    belief = Belief(HERE, SMALL.covariance())
    (step,) = FILTER.update(belief, None, HOVER, 0.17, draws(0))
    expected = predict(belief, HOVER, ROBOT, 0.17, SMALL)
    assert step.outcome is FilterOutcome.PREDICTED_ONLY
    torch.testing.assert_close(posterior(step).covariance, expected.covariance)


def noise_image(seed: int) -> Tensor:
    return torch.randint(0, 256, SHAPE, generator=draws(seed), dtype=torch.uint8)


WRONG = {
    "black": torch.zeros(SHAPE, dtype=torch.uint8),
    "white": torch.full(SHAPE, 255, dtype=torch.uint8),
    "grey": torch.full(SHAPE, 128, dtype=torch.uint8),
    "noise": noise_image(0),
    "mirrored": picture(balls(), HERE).flip(1),
    "upside down": picture(balls(), HERE).flip(0),
}


@pytest.mark.parametrize("kind", WRONG)
def test_no_picture_breaks_the_belief(kind: str):
    (*_, step) = FILTER.update(Belief(HERE, SMALL.covariance()), WRONG[kind], HOVER, DT, draws(0))
    assert_sound(posterior(step))
    if kind in ("black", "white", "grey"):
        assert step.outcome is FilterOutcome.PREDICTED_ONLY
    if kind == "noise":
        assert step.outcome is FilterOutcome.DIVERGED


@pytest.mark.parametrize(
    "image", [torch.zeros(SHAPE), torch.full(SHAPE, float("nan")), torch.zeros(3, 3, 3, dtype=torch.uint8)]
)
def test_pictures_of_another_kind_are_refused(image: Tensor):
    with pytest.raises(InvalidInputError, match="this camera takes uint8 pictures of 20 x 24 x 3"):
        FILTER.update(Belief(HERE, SMALL.covariance()), image, HOVER, DT, draws(0))


def test_light_after_ten_frames_under_a_lens_cap_finds_the_robot_again():
    belief, truth = Belief(HERE, SMALL.covariance()), HERE
    quiet = replace(CONFIG, process_noise=StateNoise(0.003, 0.003, 0.003, 0.003))
    filter_ = replace(FILTER, config=quiet)
    for _ in range(10):
        truth = ROBOT.step(truth, HOVER, DT)
        (step,) = filter_.update(belief, WRONG["black"], HOVER, DT, draws(0))
        belief = posterior(step)
    truth = truth.retract(torch.tensor([0.03, 0.02, -0.02, 0, 0, 0, 0.02, 0.0, 0.03, 0, 0, 0]))
    for _ in range(2):
        (*_, step) = filter_.correct(belief, picture(balls(), truth), draws(1))
        belief = posterior(step)
    assert truth.local(belief.mean)[:3].norm() < 5e-3


def test_updates_whose_time_steps_vary_follow_a_robot():
    belief, truth, generator = Belief(HERE, SMALL.covariance()), HERE, draws(7)
    push = HOVER + torch.tensor([0.2, 0.0, 0.0, 0.0])
    for dt in (0.07, 0.13):
        truth = ROBOT.step(truth, push, dt)
        (*_, step) = FILTER.update(belief, picture(balls(), truth, generator), push, dt, generator)
        assert step.outcome is FilterOutcome.UPDATED
        belief = posterior(step)
        assert truth.local(belief.mean)[:3].norm() < 5e-3
    assert_sound(belief)


def test_a_turned_picture_leaves_a_sound_belief_that_knows_it_is_lost():
    square = replace(FILTER, camera=Camera.from_fov(20, 20, 80))
    image = picture(balls(), HERE)[:, 2:22].rot90().contiguous()
    (*_, step) = square.update(Belief(HERE, SMALL.covariance()), image, HOVER, DT, draws(0))
    assert_sound(posterior(step))
    assert step.outcome is FilterOutcome.DIVERGED


@pytest.mark.parametrize("draw", PixelDraw)
def test_a_picture_improves_the_pose_however_its_pixels_are_drawn(draw: PixelDraw):
    config = replace(CONFIG, pyramid=replace(PYRAMID, pixels=150, draw=draw))
    steps, truth, prediction = update(0, replace(FILTER, config=config))
    assert len(steps[-1].pixels) == 150
    assert posterior(steps[-1]).mean.local(truth)[:3].norm() < 0.4 * prediction.mean.local(truth)[:3].norm()


def test_a_lens_that_bends_lines_is_seen_through():
    bent = replace(CAMERA, distortion=(-0.2, 0.03, 1e-3, -1e-3))
    truth = HERE.retract(torch.tensor([0.01, -0.01, 0.01, 0, 0, 0, 0.01, 0.01, -0.01, 0, 0, 0]))
    color = render_image(balls(), bent, truth.pose.compose(FORWARD_MOUNT)).color
    image = (255 * color).round().to(torch.uint8)
    *_, aware = replace(FILTER, camera=bent).correct(Belief(HERE, SMALL.covariance()), image, draws(0))
    *_, blind = FILTER.correct(Belief(HERE, SMALL.covariance()), image, draws(0))
    error = truth.local(posterior(aware).mean)[:3].norm()
    assert error < 2e-3 and error < truth.local(posterior(blind).mean)[:3].norm()


def test_a_prior_without_any_spread_is_refused_unless_the_dynamics_add_some():
    flat = Belief(HERE, torch.zeros(12, 12))
    (*_, step) = FILTER.update(flat, picture(balls(), HERE), HOVER, DT, draws(0))
    assert_sound(posterior(step))
    still = replace(FILTER, config=replace(CONFIG, process_noise=StateNoise(0.0, 0.0, 0.0, 0.0)))
    with pytest.raises(InvalidInputError, match="not finite and positive definite"):
        list(still.update(flat, picture(balls(), HERE), HOVER, DT, draws(0)))


def test_a_picture_whose_edges_are_in_one_corner_is_worth_one_patch():
    corner = torch.zeros(100, 100, 3, dtype=torch.uint8)
    corner[2:6, 2:6] = 255
    assert patches(corner) == pytest.approx(1.0)
    assert patches(torch.randint(0, 256, (100, 100, 3), generator=draws(0), dtype=torch.uint8)) > 90
    assert patches(torch.zeros(100, 100, 3, dtype=torch.uint8)) == 1


def test_a_wall_without_anything_on_it_is_worth_one_patch_however_large_it_is():
    shaded = 120 + 0.1 * torch.arange(100.0)[None, :, None] + torch.randn(100, 100, 3, generator=draws(0))
    wall = shaded.round().to(torch.uint8)
    assert patches(wall) > 90, "all of its patches are alike"
    assert patches(wall, noise_std=0.05) == 1
    textured = torch.randint(0, 256, (100, 100, 3), generator=draws(0), dtype=torch.uint8)
    assert patches(textured, noise_std=0.05) > 0.85 * patches(textured)
    half = torch.cat([textured[:, :50], wall[:, 50:]], 1)
    assert patches(half, noise_std=0.05) == pytest.approx(0.5 * patches(textured), rel=0.2)


def test_the_process_term_is_that_of_the_papers_cost():
    """Its process term is that of Eq. 6."""
    steps, _, prediction = update(5)
    step = steps[-1]
    colors = CONFIG.color_noise
    seen = Observation.of(picture(balls(), HERE), step.pixels, (balls(), CAMERA, FORWARD_MOUNT))
    cost = PoseCost.of(seen, prediction, replace(colors, alike=1.0))
    assert cost.process(step.mean).item() == pytest.approx(step.process, rel=0.02, abs=1e-3)
