"""Secants: what a picture tells over the whole uncertainty, and descents by that where slopes mislead."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from torch import Tensor

from nerfnav.core.errors import InvalidNumberError
from nerfnav.core.steps import run_steps
from nerfnav.estimator.core.belief import POSE, Belief
from nerfnav.estimator.core.filter_config import FilterConfig
from nerfnav.estimator.gauss_newton.aligned_filter import AlignedFilter
from nerfnav.estimator.gauss_newton.alignment import align, start_at_mean
from nerfnav.estimator.gauss_newton.fast_filter import FastFilter
from nerfnav.estimator.gauss_newton.posterior import Minimum, UpdateProblem, information_at
from nerfnav.estimator.gauss_newton.secant import descend_secant, measure_information
from nerfnav.estimator.photometric.kernels.secant import sum_secants
from nerfnav.estimator.photometric.levenberg_marquardt import (
    Guess,
    NewtonConfig,
    Prior,
    improve,
    join_information,
    picture_information,
)
from nerfnav.estimator.photometric.pixel_selection import draw_by_gradient
from nerfnav.estimator.photometric.pyramid import SecantConfig
from nerfnav.estimator.photometric.residuals import ColorNoise, FieldCamera, Observation
from nerfnav.estimator.photometric.secant import invert, measure_secants, settle_information
from nerfnav.field.models.levels import raw_of
from nerfnav.field.models.voxel import VoxelField
from nerfnav.geometry.camera import FORWARD_MOUNT
from nerfnav.geometry.grid import node_positions, shape_for
from nerfnav.robots import StateNoise
from tests.estimator.places import (
    BOX,
    CAMERA,
    COLOR_STD,
    HERE,
    ROBOT,
    balls,
    collect,
    draws,
    near,
    picture,
    voxel_balls,
)

EXPOSURE = torch.eye(2) * 1e8
PIXELS = CAMERA.pixels()


def stained(size: float, seed: int = 0) -> VoxelField:
    """The balls with stains in their colours, from node to node."""
    field = voxel_balls()
    values = field.values.clone()
    values[..., 1:] += size * torch.randn(values[..., 1:].shape, generator=draws(seed))
    return replace(field, values=values)


def plain(stains: float = 0.0) -> VoxelField:
    """The balls in two shades of grey before a grey background on a grid of 12 mm, with stains of the field."""
    field = balls()
    points = node_positions(BOX, shape_for(BOX, 0.012))
    colors = field.radiance(points, torch.zeros_like(points))
    values = torch.cat([raw_of(field.density(points))[..., None], colors], -1)
    values[..., 1:] = 0.5 + 0.12 * (values[..., 1:] - 0.5)
    values[..., 1:] += stains * torch.randn(values[..., 1:].shape, generator=draws(0))
    return VoxelField(BOX, values, torch.full((3,), 0.5))


def secant_information(field: VoxelField, deviation: float) -> Tensor:
    seen = Observation(field, CAMERA, FORWARD_MOUNT, PIXELS, torch.zeros(len(PIXELS), 3))
    covariance = deviation**2 * torch.eye(6)
    secants = measure_secants(seen, Guess.at(HERE.pose[None]), covariance, 0.02, 10.0)
    return secants.pose_information(1.0, EXPOSURE).float()


def slope_information(field: VoxelField) -> Tensor:
    seen = Observation(field, CAMERA, FORWARD_MOUNT, PIXELS, torch.zeros(len(PIXELS), 3))
    prior = Prior(torch.block_diag(torch.zeros(6, 6), EXPOSURE), None, 0.02**-2)
    *_, here = improve(seen, Guess.at(HERE.pose[None]), prior, NewtonConfig(0, robust=10.0), every=False)
    return picture_information(here)


SMALL = 1e-4 * torch.eye(6)
"""Cholesky factor of a covariance over which colours are straight."""


def all_pixels() -> Observation:
    return Observation.of(picture(balls(), HERE), CAMERA.pixels(), FieldCamera(balls(), CAMERA, FORWARD_MOUNT))


def told_over(root: Tensor, alike: float = 1.0) -> Tensor:
    """Information over the covariance with a Cholesky factor."""
    exposure = join_information(None, (0.1, 0.05))[6:, 6:]
    secants = measure_secants(all_pixels(), Guess.at(HERE.pose[None]), root @ root.T, COLOR_STD, 10.0)
    return secants.pose_information(alike, exposure).float()


def test_sums_over_parts_of_a_picture_add_up_to_those_over_all() -> None:
    seen, guess = all_pixels(), Guess.at(HERE.pose[None])
    parts = [replace(seen, pixels=seen.pixels[some], colors=seen.colors[some]) for some in (slice(50), slice(50, None))]
    first, second, whole = (measure_secants(part, guess, SMALL, COLOR_STD, 0.05) for part in (*parts, seen))
    both = first + second
    assert first.pixels == 50 and both.pixels == whole.pixels == len(seen.pixels)
    torch.testing.assert_close(both.information, whole.information)
    torch.testing.assert_close(both.push, whole.push)
    assert both.misfit == pytest.approx(whole.misfit) and first.misfit != pytest.approx(second.misfit)


def test_the_compiled_sums_are_those_of_the_equations() -> None:
    shown = torch.rand(12, 40, 3, generator=draws(0))
    colors, (gain, bias), noise, robust = torch.rand(40, 3, generator=draws(1)), (0.1, -0.05), 0.02, 0.3
    information, push = np.empty((8, 8)), np.empty(8)
    bounds = 6.0**0.5, noise**2, robust
    misfit = sum_secants(shown.numpy(), colors.numpy(), (gain, bias), bounds, information, push)

    ahead, behind = shown.double().flatten(1).chunk(2)
    mean, slopes = 0.5 * (ahead + behind).mean(0), (ahead - behind) / (2 * bounds[0])
    bent = (torch.cat([ahead, behind]) - mean).square().mean(0) - slopes.square().sum(0)
    residual = (1 + gain) * mean + bias - colors.double().flatten()
    assert (residual.abs() > robust).any()
    weight = (robust / residual.abs()).clamp_max(1) / (noise**2 + bent)
    columns = torch.cat([(1 + gain) * slopes, mean[None], torch.ones_like(mean)[None]]).T
    np.testing.assert_allclose(information, columns.T @ (weight[:, None] * columns), rtol=1e-9)
    np.testing.assert_allclose(push, columns.T @ (weight * residual), rtol=1e-9, atol=1e-9)
    assert misfit == pytest.approx(float((weight * residual.square()).mean()))


def test_over_a_small_covariance_it_is_the_information_of_slopes_with_gain_and_bias_marginalised() -> None:
    seen, noise = all_pixels(), 3.0 * COLOR_STD**2
    _, by_pose = seen.linearised(HERE.pose[None])
    jacobian = torch.cat([by_pose[0], seen.colors[..., None], torch.ones(len(seen.pixels), 3, 1)], -1).flatten(0, 1)
    joint = jacobian.T @ jacobian / noise + join_information(None, (0.1, 0.05))
    expected = torch.linalg.inv(torch.linalg.inv(joint)[:6, :6])
    found = told_over(SMALL, 3.0)
    assert (found - expected).norm() < 0.02 * expected.norm()


def test_correlated_axes_of_the_covariance_do_not_change_it() -> None:
    skewed = SMALL @ torch.eye(6).add(0.5 * torch.ones(6, 6).tril(-1))
    found = [told_over(root) for root in (SMALL, skewed)]
    assert (found[1] - found[0]).norm() < 0.02 * found[0].norm()


def test_a_picture_tells_less_over_a_wide_covariance() -> None:
    narrow, wide = (told_over(size * SMALL) for size in (1.0, 500.0))
    assert (wide.diagonal() < 0.5 * narrow.diagonal()).all()


def test_stains_raise_what_slopes_promise_and_not_what_secants_tell():
    clean, rough = voxel_balls(), stained(0.1)
    promised = torch.logdet(slope_information(rough)) - torch.logdet(slope_information(clean))
    told = torch.logdet(secant_information(rough, 0.03)) - torch.logdet(secant_information(clean, 0.03))
    assert promised > 1.0
    assert told < 0.3


def minimum_in(field: VoxelField, place: VoxelField) -> tuple[UpdateProblem, Minimum]:
    """The end of a descent by slopes, for a picture of a place and a prior of 3 cm."""
    config = FilterConfig(color_noise=ColorNoise(std=0.02, per_patch=20.0, few_patches=1.0))
    view = FastFilter(field, ROBOT, CAMERA, config=config).view
    prediction = Belief(HERE, StateNoise(0.03, 0.01, 0.03, 0.01).covariance())
    problem = UpdateProblem(view, config, prediction, picture(place, HERE), draws(0))
    _, minimum = collect(align(problem, config.pyramid.stages(many=False), start_at_mean(problem)))
    return problem, minimum


@pytest.mark.slow
def test_information_is_measured_by_secants_only_where_slopes_overstate_it():
    problem, minimum = minimum_in(voxel_balls(), voxel_balls())
    assert measure_information(problem, minimum).information is None
    problem, minimum = minimum_in(plain(stains=0.06), plain())
    measured = measure_information(problem, minimum).information
    assert measured is not None
    known, slopes = problem.pose_information, information_at(problem, minimum)
    narrower = torch.logdet(slopes + known) - torch.logdet(measured + known)
    assert narrower > 1.0
    assert torch.linalg.eigvalsh(measured).min() > 0


@pytest.mark.slow
def test_an_aligned_picture_tells_less_where_slopes_overstate_it():
    without = SecantConfig(overstated=float("inf"))
    config = FilterConfig(color_noise=ColorNoise(std=0.02, per_patch=20.0, few_patches=1.0))
    prediction = Belief(HERE, StateNoise(0.03, 0.01, 0.03, 0.01).covariance())

    def widened_by_secants(field: VoxelField, place: VoxelField) -> float:
        """Logarithm of how many times the covariance of the pose grows."""
        measured, slopes = (
            run_steps(AlignedFilter(field, CAMERA, config=each).correct(prediction, picture(place, HERE), draws(0)))
            for each in (config, replace(config, pyramid=replace(config.pyramid, secant=without)))
        )
        covariances = [result.posterior.covariance[POSE][:, POSE].double() for result in (measured, slopes)]
        return float(torch.logdet(covariances[0]) - torch.logdet(covariances[1]))

    assert widened_by_secants(voxel_balls(), voxel_balls()) == 0.0
    assert widened_by_secants(plain(stains=0.06), plain()) > 1.0


def test_a_descent_by_secants_reaches_the_picture_from_a_wide_prediction():
    """On a place without stains it ends where the picture was taken."""
    field, away = voxel_balls(), torch.tensor([0.03, -0.02, 0.02, 0, 0, 0, 0.02, -0.03, 0.03, 0, 0, 0])
    config = FilterConfig(gain_std=0, bias_std=0)
    view = FastFilter(field, ROBOT, CAMERA, config=config).view
    prediction = Belief(HERE.retract(away), StateNoise(0.03, 0.01, 0.03, 0.01).covariance())
    problem = UpdateProblem(view, config, prediction, picture(field, HERE), draws(0))
    _, before = collect(align(problem, config.pyramid.stages(many=False)[:1], start_at_mean(problem)))
    end, rival = descend_secant(problem, before)
    assert rival is None or rival.iterate.cost[0] > end.iterate.cost[0]
    assert (end.iterate.guess.pose.position[0] - HERE.position).norm() < 2e-3
    assert end.step.iteration > before.step.iteration
    assert len(end.selection.places) == min(config.pyramid.pixels, len(PIXELS))


def test_where_slopes_hold_an_update_is_the_same_with_and_without_secants():
    config = FilterConfig()
    without = replace(config, pyramid=replace(config.pyramid, secant=SecantConfig(overstated=float("inf"))))
    prediction: Belief = near(HERE, 3, StateNoise(0.004, 0.004, 0.004, 0.004))
    image = picture(voxel_balls(), HERE)
    first, second = (
        run_steps(FastFilter(voxel_balls(), ROBOT, CAMERA, config=each).correct(prediction, image, draws(0)))
        for each in (config, without)
    )
    assert torch.equal(first.posterior.covariance, second.posterior.covariance)
    assert torch.equal(first.posterior.mean.position, second.posterior.mean.position)


def test_pixels_are_drawn_where_the_picture_is_steep():
    image = torch.full((20, 40, 3), 90, dtype=torch.uint8)
    image[:, 30:] = 200
    pixels = draw_by_gradient(image, 60, draws(0))
    assert len({tuple(pixel) for pixel in pixels.tolist()}) == 60
    assert (pixels[:, 0] - 30).abs().max() <= 4


@pytest.mark.parametrize("option", [{"checked": 0}, {"widened": 0.0}, {"settle": 0}, {"rounds": -1}])
def test_secants_that_measure_nothing_are_refused(option: dict[str, float]) -> None:
    with pytest.raises(InvalidNumberError, match=f"{next(iter(option))} must be a number"):
        SecantConfig(**option)  # type: ignore[arg-type]


def test_a_second_round_is_measured_over_what_the_first_leaves() -> None:
    seen, known = all_pixels(), join_information(1e4 * torch.eye(6), (0.1, 0.05))
    guess, over = Guess.at(HERE.pose[None]), 1e-4 * torch.eye(6).double()
    first, second = (settle_information(seen, guess, over, known, COLOR_STD, 1.0, 10.0, rounds) for rounds in (1, 2))
    left = invert(first + known[:6, :6].double())
    assert torch.equal(second, settle_information(seen, guess, left, known, COLOR_STD, 1.0, 10.0, 1))
    assert not torch.equal(first, second)
