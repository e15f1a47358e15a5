"""The fast filter, from a picture to a posterior."""

import math
from dataclasses import replace

import pytest
import torch
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.core.steps import run_steps
from nerfnav.estimator.core.belief import Belief
from nerfnav.estimator.core.filter_config import FilterConfig
from nerfnav.estimator.core.filter_step import FilterOutcome
from nerfnav.estimator.core.prediction import predict
from nerfnav.estimator.gauss_newton.alignment import align, start_at_mean
from nerfnav.estimator.gauss_newton.fast_filter import FastFilter, inerf
from nerfnav.estimator.gauss_newton.posterior import UpdateProblem, normalise_move
from nerfnav.estimator.paper.cost import PoseCost
from nerfnav.estimator.photometric.pixel_selection import PixelDraw
from nerfnav.estimator.photometric.pyramid import PyramidConfig, SearchConfig
from nerfnav.estimator.photometric.residuals import ColorNoise, FieldCamera, Observation, count_patches
from nerfnav.field.core.info import FieldInfo
from nerfnav.field.models.levels import raw_of
from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.render.volume_rendering import render_image
from nerfnav.geometry.box import Box
from nerfnav.geometry.camera import FORWARD_MOUNT, Camera
from nerfnav.geometry.grid import node_positions, shape_for
from nerfnav.robots import StateNoise
from nerfnav.robots.state import RigidState
from tests.estimator.places import CAMERA, COLOR_STD, DT, HERE, HOVER, ROBOT, Updated, balls, draws, picture, updated
from tests.field.fields import random_voxels

SMALL = StateNoise(0.01, 0.01, 0.01, 0.01)
SEARCH = SearchConfig(candidates=12, starts=3, pixels=(60, 100), iterations=(2, 3, 8))
PYRAMID = PyramidConfig(halvings=(1, 0), robust=(0.5, 0.1), iterations=(4, 10), candidates=12, starts=3, search=SEARCH)
CONFIG = FilterConfig(
    pyramid=PYRAMID, process_noise=SMALL, color_noise=ColorNoise(std=COLOR_STD, per_patch=10.0), gain_std=0, bias_std=0,
    floor=StateNoise(0.0, 0.0, 0.0, 0.0), grain=0.0,
)  # fmt: skip
FILTER = FastFilter(balls(), ROBOT, CAMERA, config=CONFIG)
SHAPE = (CAMERA.height, CAMERA.width, 3)


def update(seed: int, filter_: FastFilter = FILTER) -> Updated:
    """One update of HERE's belief under SMALL noise, see `updated`."""
    return updated(filter_, SMALL, seed)


def assert_sound(belief: Belief) -> None:
    """A covariance must always be symmetric and positive definite, and everything finite."""
    covariance = belief.covariance
    assert torch.equal(covariance, covariance.T) or torch.allclose(covariance, covariance.T, atol=1e-9)
    assert torch.linalg.eigvalsh(covariance.double()).min() > 0
    assert belief.mean.position.isfinite().all() and belief.mean.rotation.isfinite().all()


def test_a_picture_makes_the_pose_many_times_better():
    _, result, truth, prediction = update(0)
    before, after = prediction.mean.local(truth), result.posterior.mean.local(truth)
    assert result.outcome is FilterOutcome.UPDATED
    assert after[:3].norm() < 0.3 * before[:3].norm()
    assert after[6:9].norm() < 0.3 * before[6:9].norm()


def test_every_iteration_is_yielded_and_the_last_step_has_the_posteriors_mean():
    steps, result, *_ = update(1)
    assert steps[-1] is result.step
    assert torch.equal(result.step.mean.position, result.posterior.mean.position)
    numbers = [step.iteration for step in steps]
    assert numbers[:-1] == [*range(len(steps) - 1)] and numbers[-1] == numbers[-2]


def test_derivatives_of_what_a_body_sees_are_those_of_finite_differences():
    off_centre = replace(FORWARD_MOUNT, position=torch.tensor([0.05, 0.02, 0.03]))
    seen = Observation.of(picture(balls(), HERE), CAMERA.pixels()[::7], FieldCamera(balls(), CAMERA, off_centre))
    _, jacobian = seen.linearised(HERE.pose.map(lambda tensor: tensor[None]))
    samples, h = seen.samples(HERE), 1e-3
    for column, index in enumerate((0, 1, 2, 6, 7, 8)):
        step = torch.zeros(12)
        step[index] = h
        slope = (seen.residual(HERE.retract(step), samples) - seen.residual(HERE.retract(-step), samples)) / (2 * h)
        assert (jacobian[0, ..., column] - slope).norm() < 0.03 * slope.norm()


def test_velocity_moves_through_the_predictions_cross_covariance():
    _, result, _, prediction = update(2, replace(FILTER, config=replace(CONFIG, adaptive=False)))
    last = result.posterior.mean
    pose = [0, 1, 2, 6, 7, 8]
    change = prediction.mean.local(last)
    covariance = prediction.covariance
    expected = covariance[3:6][:, pose] @ torch.linalg.solve(covariance[pose][:, pose], change[pose])
    torch.testing.assert_close(change[3:6], expected, atol=1e-5, rtol=1e-3)


def test_the_exact_covariance_is_near_that_of_gauss_newton():
    quick = update(3).result.posterior.covariance
    exact = update(3, replace(FILTER, config=replace(CONFIG, exact_covariance=True))).result.posterior.covariance
    ratio = quick.diagonal()[:3].sqrt() / exact.diagonal()[:3].sqrt()
    assert ((ratio > 0.5) & (ratio < 2)).all()


def test_a_darker_picture_finds_the_same_place_when_exposure_is_estimated():
    filter_ = replace(FILTER, config=replace(CONFIG, gain_std=0.3, bias_std=0.1))
    truth = HERE.retract(torch.tensor([0.01, -0.01, 0.01, 0, 0, 0, 0.01, 0.01, -0.01, 0, 0, 0]))
    dark = (0.75 * picture(balls(), truth).float() + 12).round().to(torch.uint8)
    prediction = Belief(HERE, SMALL.covariance())
    aware = run_steps(filter_.correct(prediction, dark, draws(0)))
    blind = run_steps(FILTER.correct(prediction, dark, draws(0)))
    error = truth.local(aware.posterior.mean)[:3].norm()
    assert error < 2e-3 and error < truth.local(blind.posterior.mean)[:3].norm()


def test_pixels_that_something_covers_do_not_pull_the_estimate_when_they_are_hidden():
    truth = HERE.retract(torch.tensor([0.01, -0.01, 0.01, 0, 0, 0, 0.01, 0.01, -0.01, 0, 0, 0]))
    image, prediction = picture(balls(), truth), Belief(HERE, SMALL.covariance())
    hidden = torch.zeros(image.shape[:2], dtype=torch.bool)
    hidden[:, : image.shape[1] // 2] = True
    covered = torch.where(hidden[..., None], torch.tensor([230, 120, 20], dtype=torch.uint8), image)
    masked = run_steps(FILTER.correct(prediction, covered, draws(0), hidden=hidden))
    assert truth.local(masked.posterior.mean)[:3].norm() < 4e-3
    pixels = masked.step.pixels
    assert not hidden[pixels[:, 1], pixels[:, 0]].any()
    none = run_steps(FILTER.correct(prediction, covered, draws(0), hidden=torch.ones_like(hidden)))
    assert none.outcome is FilterOutcome.PREDICTED_ONLY and none.posterior is prediction


def test_inerf_ignores_the_prediction_once_it_has_started():
    _, result, truth, prediction = update(4, inerf(balls(), ROBOT, CAMERA, config=CONFIG))
    last = result.posterior.mean
    assert truth.local(last)[:3].norm() < 0.3 * truth.local(prediction.mean)[:3].norm()
    torch.testing.assert_close(last.velocity, prediction.mean.velocity)


def test_without_a_picture_the_dynamics_alone_move_the_belief():
    belief = Belief(HERE, SMALL.covariance())
    step = run_steps(FILTER.update(belief, None, HOVER, 0.17, draws(0)))
    expected = predict(belief, HOVER, ROBOT, 0.17, SMALL)
    assert step.outcome is FilterOutcome.PREDICTED_ONLY
    torch.testing.assert_close(step.posterior.covariance, expected.covariance)


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
    step = run_steps(FILTER.update(Belief(HERE, SMALL.covariance()), WRONG[kind], HOVER, DT, draws(0)))
    assert_sound(step.posterior)
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
        step = run_steps(filter_.update(belief, WRONG["black"], HOVER, DT, draws(0)))
        belief = step.posterior
    truth = truth.retract(torch.tensor([0.03, 0.02, -0.02, 0, 0, 0, 0.02, 0.0, 0.03, 0, 0, 0]))
    for _ in range(2):
        step = run_steps(filter_.correct(belief, picture(balls(), truth), draws(1)))
        belief = step.posterior
    assert truth.local(belief.mean)[:3].norm() < 5e-3


def test_updates_whose_time_steps_vary_follow_a_robot():
    belief, truth, generator = Belief(HERE, SMALL.covariance()), HERE, draws(7)
    push = HOVER + torch.tensor([0.2, 0.0, 0.0, 0.0])
    for dt in (0.07, 0.13):
        truth = ROBOT.step(truth, push, dt)
        step = run_steps(FILTER.update(belief, picture(balls(), truth, generator), push, dt, generator))
        assert step.outcome is FilterOutcome.UPDATED
        belief = step.posterior
        assert truth.local(belief.mean)[:3].norm() < 5e-3
    assert_sound(belief)


def test_a_turned_picture_leaves_a_sound_belief_that_knows_it_is_lost():
    square = replace(FILTER, camera=Camera.from_fov(20, 20, 80))
    image = picture(balls(), HERE)[:, 2:22].rot90().contiguous()
    step = run_steps(square.update(Belief(HERE, SMALL.covariance()), image, HOVER, DT, draws(0)))
    assert_sound(step.posterior)
    assert step.outcome is FilterOutcome.DIVERGED


@pytest.mark.parametrize("draw", PixelDraw)
def test_a_picture_improves_the_pose_however_its_pixels_are_drawn(draw: PixelDraw):
    config = replace(CONFIG, pyramid=replace(PYRAMID, pixels=150, draw=draw))
    _, result, truth, prediction = update(0, replace(FILTER, config=config))
    assert len(result.step.pixels) == 150
    assert result.posterior.mean.local(truth)[:3].norm() < 0.4 * prediction.mean.local(truth)[:3].norm()


def test_a_lens_that_bends_lines_is_seen_through():
    bent = replace(CAMERA, distortion=(-0.2, 0.03, 1e-3, -1e-3))
    truth = HERE.retract(torch.tensor([0.01, -0.01, 0.01, 0, 0, 0, 0.01, 0.01, -0.01, 0, 0, 0]))
    color = render_image(balls(), bent, truth.pose.compose(FORWARD_MOUNT)).color
    image = (255 * color).round().to(torch.uint8)
    aware = run_steps(replace(FILTER, camera=bent).correct(Belief(HERE, SMALL.covariance()), image, draws(0)))
    blind = run_steps(FILTER.correct(Belief(HERE, SMALL.covariance()), image, draws(0)))
    error = truth.local(aware.posterior.mean)[:3].norm()
    assert error < 2e-3 and error < truth.local(blind.posterior.mean)[:3].norm()


def test_a_prior_without_any_spread_is_refused_unless_the_dynamics_add_some():
    flat = Belief(HERE, torch.zeros(12, 12))
    step = run_steps(FILTER.update(flat, picture(balls(), HERE), HOVER, DT, draws(0)))
    assert_sound(step.posterior)
    still = replace(FILTER, config=replace(CONFIG, process_noise=StateNoise(0.0, 0.0, 0.0, 0.0)))
    with pytest.raises(InvalidInputError, match="not finite and positive definite"):
        list(still.update(flat, picture(balls(), HERE), HOVER, DT, draws(0)))


def test_a_picture_whose_edges_are_in_one_corner_is_worth_one_patch():
    corner = torch.zeros(100, 100, 3, dtype=torch.uint8)
    corner[2:6, 2:6] = 255
    assert count_patches(corner) == pytest.approx(1.0)
    assert count_patches(torch.randint(0, 256, (100, 100, 3), generator=draws(0), dtype=torch.uint8)) > 90
    assert count_patches(torch.zeros(100, 100, 3, dtype=torch.uint8)) == 1


def test_a_wall_without_anything_on_it_is_worth_one_patch_however_large_it_is():
    shaded = 120 + 0.1 * torch.arange(100.0)[None, :, None] + torch.randn(100, 100, 3, generator=draws(0))
    wall = shaded.round().to(torch.uint8)
    assert count_patches(wall) > 90, "all of its patches are alike"
    assert count_patches(wall, noise_std=0.05) == 1
    textured = torch.randint(0, 256, (100, 100, 3), generator=draws(0), dtype=torch.uint8)
    assert count_patches(textured, noise_std=0.05) > 0.85 * count_patches(textured)
    half = torch.cat([textured[:, :50], wall[:, 50:]], 1)
    assert count_patches(half, noise_std=0.05) == pytest.approx(0.5 * count_patches(textured), rel=0.2)


def test_a_wall_counts_in_a_field_whose_errors_are_at_few_edges_alone():
    shades = 120 + 6 * torch.randn(100, 100, 1, generator=draws(0)).expand(100, 100, 3)
    wall = shades.round().to(torch.uint8)
    noise, field = ColorNoise(std=0.04), random_voxels()
    sharp, even = (replace(field, info=FieldInfo(noise_core_std=core)) for core in (0.004, 0.03))
    counted = count_patches(wall, noise_std=noise.usual_std(sharp))
    assert counted > 2 * count_patches(wall, noise_std=0.04) and counted > 70
    assert noise.usual_std(even) == noise.usual_std(field) == noise.usual_std(balls()) == 0.04


def test_the_process_term_is_that_of_the_papers_cost():
    """Its process term is that of Eq. 6."""
    _, result, _, prediction = update(5)
    step = result.step
    colors = CONFIG.color_noise
    seen = Observation.of(picture(balls(), HERE), step.pixels, FieldCamera(balls(), CAMERA, FORWARD_MOUNT))
    cost = PoseCost.of(seen, prediction, replace(colors, alike=1.0))
    assert cost.process(step.mean).item() == pytest.approx(step.process, rel=0.02, abs=1e-3)


@pytest.mark.parametrize("stretch", [0.5, 0.0, -1.0, math.nan, math.inf])
def test_steps_that_would_be_shortened_or_go_back_are_refused(stretch: float):
    with pytest.raises(InvalidInputError, match="stretch must be a number, at least 1"):
        PyramidConfig(stretch=stretch)


OFF = torch.tensor([0.01, -0.01, 0.01, 0, 0, 0, 0.01, 0.01, -0.01, 0, 0, 0])


def test_a_picture_that_nothing_found_explains_is_as_likely_as_not_of_somewhere_else():
    truth, prediction = HERE.retract(OFF), Belief(HERE, SMALL.covariance())
    clean = picture(balls(), truth).float()
    noise = 255 * COLOR_STD * torch.randn(clean.shape, generator=draws(1))
    noisy, noisier = ((clean + size * noise).clamp(0, 255).round().to(torch.uint8) for size in (1.0, 1.8))
    explained = run_steps(FILTER.correct(prediction, noisy, draws(0)))
    doubtful = run_steps(FILTER.correct(prediction, noisier, draws(0)))
    assert explained.outcome is FilterOutcome.UPDATED and doubtful.outcome is FilterOutcome.WEAK
    sure, unsure = explained.posterior, doubtful.posterior
    assert sure.mean.local(truth)[:3].norm() < 2e-3
    assert (unsure.mean.local(truth)[:3] - 0.5 * OFF[:3]).norm() < 3e-3, "half way to where the picture leads"
    away = unsure.mean.local(HERE)
    least = 0.5 * prediction.covariance + torch.outer(away, away)
    assert torch.linalg.eigvalsh(unsure.covariance - least).min() > -1e-7, "half of what the prediction left open"
    assert torch.linalg.eigvalsh(sure.covariance - least).min() < -2e-5
    assert_sound(unsure)


def test_a_few_strange_pixels_leave_a_picture_explained():
    truth, prediction = HERE.retract(OFF), Belief(HERE, SMALL.covariance())
    image, generator = picture(balls(), truth), draws(2)
    strange = torch.rand(*SHAPE[:2], 1, generator=generator) < 0.06
    image = torch.where(strange, torch.randint(0, 256, SHAPE, generator=generator, dtype=torch.uint8), image)
    last = run_steps(FILTER.correct(prediction, image, draws(0)))
    assert last.step.residual.square().mean().sqrt() > SEARCH.doubt * COLOR_STD, "it is searched with all the same"
    assert last.outcome is FilterOutcome.UPDATED
    assert last.posterior.mean.local(truth)[:3].norm() < 4e-3


def test_a_doubtful_end_far_from_the_prediction_is_left():
    prediction = Belief(HERE, StateNoise(0.004, 0.004, 0.004, 0.004).covariance())
    clean = picture(balls(), HERE.retract(OFF)).float()
    noise = 1.8 * 255 * COLOR_STD * torch.randn(clean.shape, generator=draws(1))
    last = run_steps(FILTER.correct(prediction, (clean + noise).clamp(0, 255).round().to(torch.uint8), draws(0)))
    assert last.step.process > 12.6 and last.outcome is FilterOutcome.WEAK
    torch.testing.assert_close(last.posterior.covariance, prediction.covariance)
    torch.testing.assert_close(last.posterior.mean.position, HERE.position)


def test_a_move_is_compared_with_what_the_picture_can_tell():
    """chi-squared by P - (P^-1 + I)^-1: the move's own square where the picture tells all, far more where little."""
    truth, prediction = HERE.retract(OFF), Belief(HERE, SMALL.covariance())
    problem = UpdateProblem(FILTER.view, CONFIG, prediction, picture(balls(), truth), draws(0))
    minimum = run_steps(align(problem, CONFIG.pyramid.stages(False), start_at_mean(problem)))
    all_told, little = (
        normalise_move(problem, replace(minimum, information=share * problem.pose_information))
        for share in (1e6, 0.1)
    )
    assert all_told == pytest.approx(minimum.step.process, rel=1e-3)
    assert little == pytest.approx(11 * all_told, rel=1e-3), "a tenth of the prior's information explains 1 / 11"


_PERIOD = 0.04


def stripes() -> VoxelField:
    """A blank wall ahead with a band of upright stripes that goes on to both sides, so that it looks the same from
    wherever the camera is moved to by a period of 4 cm."""
    box = Box.of((0.0, -0.9, 0.0), (0.6, 0.9, 0.5))
    points = node_positions(box, shape_for(box, 0.01))
    wave = 0.5 + 0.4 * torch.sin(2 * torch.pi * points[..., 1] / _PERIOD)
    band = (points[..., 2] - 0.27).abs() < 0.012
    color = torch.where(band, wave, torch.full_like(wave, 0.5))[..., None].expand(*wave.shape, 3)
    density = torch.where(points[..., 0] > 0.55, 400.0, 0.0)
    return VoxelField(box, torch.cat([raw_of(density)[..., None], color], -1), torch.zeros(3))


def beside_stripes(shift: float, rounds: int) -> tuple[float, Belief, float]:
    """Of a robot before the stripes that is `shift` beside where it is predicted [m]: how far off its belief is in
    that direction in the end, the belief, and how many patches the picture has."""
    field, camera = stripes(), Camera.from_fov(96, 80, 60)
    here = RigidState.at_rest((0.1, 0.0, 0.25))
    truth = here.retract(torch.tensor([0.0, shift, *[0.0] * 10]))
    image = (255 * render_image(field, camera, truth.pose.compose(FORWARD_MOUNT)).color.clamp(0, 1)).round()
    image = image.to(torch.uint8)
    noise = StateNoise(0.02, 0.01, 0.001, 0.01)
    config = FilterConfig(color_noise=ColorNoise(std=0.03))
    config = replace(config, pyramid=replace(config.pyramid, search=replace(config.pyramid.search, rounds=rounds)))
    filter_ = FastFilter(field, ROBOT, camera, config=config)
    last = run_steps(filter_.correct(Belief(here, noise.covariance()), image, draws(3)))
    belief = last.posterior
    return float(belief.mean.local(truth)[1]), belief, count_patches(image, noise_std=0.03)


def test_where_two_minima_are_alike_the_covariance_covers_both():
    shift = 0.65 * _PERIOD
    (alone, sure, independent), (off, unsure, _) = beside_stripes(shift, rounds=0), beside_stripes(shift, rounds=1)
    deviation = float(sure.covariance[1, 1].sqrt())
    assert independent < SearchConfig().patches
    assert abs(abs(alone) - _PERIOD) < 0.006, "the nearest stripe is a wrong one"
    assert deviation < 0.3 * _PERIOD, "Laplace's covariance sees one minimum"
    spread = float(unsure.covariance[1, 1].sqrt())
    assert spread > 0.4 * _PERIOD and abs(off) < 2.4 * spread, "with the other, it says so"
    assert_sound(unsure)
