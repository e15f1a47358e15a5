"""Photographs of different exposure."""

from dataclasses import replace

import pytest
import torch

from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.proof.carving import CarvingConfig, carve_free_space
from nerfnav.field.render.volume_rendering import render_image
from nerfnav.field.train.evaluation import calibrate_noise
from nerfnav.field.train.exposure import (
    QUARTERS,
    ExposureCorrection,
    correct_exposure,
    estimate_common_gains,
    estimate_gains,
)
from nerfnav.field.train.grid_learner import GridLearner
from nerfnav.field.train.rays import RaySampler
from nerfnav.field.train.torch_learner import TorchLearner
from nerfnav.geometry import PosedImages
from tests.field.fields import photographs_of_ball, random_voxels, random_voxels_in_a_room

GAINS = torch.tensor([[0.8, 0.8, 0.8], [1.0, 1.05, 1.0], [1.1, 1.1, 1.1], [1.25, 1.2, 1.25]])


def photographs_of(field: VoxelField, gain: torch.Tensor, size: int = 32) -> PosedImages:
    """Pictures of a field from a ring around it, each brighter by its gain of each channel (n, 3)."""
    views = photographs_of_ball(len(gain), size)
    shown = torch.stack([render_image(field, views.camera, views.poses[k]).color for k in range(len(gain))])
    return replace(views, images=(255 * 0.7 * gain[:, None, None] * shown).clamp(0, 255).round().to(torch.uint8))


def normalised(gain: torch.Tensor) -> torch.Tensor:
    return gain / gain.log().mean(0).exp()


def test_gains_are_found_from_what_a_field_shows_white_balance_included() -> None:
    generator = torch.Generator().manual_seed(0)
    shown = torch.rand(4, QUARTERS, 50, 3, generator=generator)
    noise = 0.02 * torch.randn(shown.shape, generator=generator)
    found = estimate_gains(0.7 * GAINS[:, None, None] * shown + noise, shown)
    assert found.log().mean(0).abs().max() < 1e-5
    torch.testing.assert_close(found, normalised(GAINS), atol=0.01, rtol=0)


def test_what_a_field_does_not_show_yet_is_not_taken_for_exposure() -> None:
    generator = torch.Generator().manual_seed(1)
    shown = torch.rand(12, QUARTERS, 50, 3, generator=generator)
    mistakes = 0.3 * torch.randn(12, QUARTERS, 1, 3, generator=generator)  # a quarter errs as a whole
    raw = ((shown + mistakes) * shown).sum((1, 2)) / shown.square().sum((1, 2))
    found = estimate_gains(shown + mistakes, shown)
    assert found.log().std() < 0.5 * raw.log().std()


def test_two_photographs_tell_nothing_of_exposure() -> None:
    shown = torch.rand(2, QUARTERS, 9, 3)
    assert torch.equal(estimate_gains(2 * shown, shown), torch.ones(2, 3))


def test_a_corrected_sampler_gives_colours_of_one_exposure() -> None:
    views = photographs_of_ball(3, size=8)
    plain, other = (RaySampler(views, torch.Generator().manual_seed(0)) for _ in range(2))
    other.correct(torch.full((3, 3), 2.0))
    one, two = plain.draw(100), other.draw(100)
    assert (one.origins == two.origins).all()
    assert one.targets == pytest.approx(2 * two.targets, abs=1e-6)


def test_rays_of_quarters_come_photograph_by_photograph_with_the_colours_as_taken() -> None:
    views = photographs_of_ball(3, size=8)
    views.images[:] = 0
    for k in range(3):
        views.images[k, :4, 4:] = 50 * (k + 1)  # the second quarter
    sampler = RaySampler(views, torch.Generator().manual_seed(0))
    sampler.correct(torch.full((3, 3), 3.0))
    drawn = 255 * torch.from_numpy(sampler.draw_quarters(5).targets).reshape(3, QUARTERS, 5, 3)
    wanted = torch.zeros(3, QUARTERS, 5, 3)
    wanted[:, 1] = torch.tensor([50.0, 100.0, 150.0])[:, None, None]
    torch.testing.assert_close(drawn, wanted)


def test_a_learner_that_knows_the_place_finds_the_gains_of_its_photographs_on_any_device() -> None:
    field = random_voxels_in_a_room()
    views, compiled = photographs_of(field, GAINS), GridLearner.of(field, 1.0, workers=1)
    found = []
    for learner in (compiled, TorchLearner.of(compiled, torch.device("cpu"))):
        sampler = RaySampler(views, torch.Generator().manual_seed(0))
        looks = ExposureCorrection(sampler, wanted=True)
        looks.look(learner, 0.01)
        assert torch.equal(sampler.gains, torch.ones(4, 3)), "it is too early"
        looks.look(learner, 0.5)
        found.append(sampler.gains)
    torch.testing.assert_close(found[0], normalised(GAINS), atol=0.03, rtol=0)
    torch.testing.assert_close(found[0], found[1], atol=0.01, rtol=0)


def test_exposure_is_taken_out_before_noise_is_told_and_raw_quality_stays_as_it_is() -> None:
    field = random_voxels()
    views = photographs_of(field, GAINS / 0.7)
    plain, fitted = (calibrate_noise(field.info, field, views, exposure) for exposure in (False, True))
    assert plain.psnr_one_exposure_db is None
    assert fitted.psnr_db == plain.psnr_db
    assert fitted.psnr_one_exposure_db is not None and plain.psnr_db is not None
    assert fitted.noise_std is not None and plain.noise_std is not None
    assert fitted.psnr_one_exposure_db > plain.psnr_db + 5
    assert fitted.noise_std < 0.5 * plain.noise_std


def test_rendered_pictures_are_judged_alike_with_and_without_exposure() -> None:
    field = random_voxels()
    generator = torch.Generator().manual_seed(2)
    views = photographs_of(field, torch.full((6, 3), 1 / 0.7))
    rough = views.images + (20 * torch.randn(6, 32, 32, 1, generator=generator))
    views = replace(views, images=rough.clamp(0, 255).to(torch.uint8))
    plain, fitted = (calibrate_noise(field.info, field, views, exposure) for exposure in (False, True))
    assert fitted.noise_std == pytest.approx(plain.noise_std, rel=0.01)


def test_pictures_of_other_exposure_prove_no_plain_wall_to_be_free() -> None:
    """A grey box, seen grey by all: nothing contradicts it, unless exposure is taken for colour."""
    values = torch.zeros(9, 9, 9, 4)
    values[..., 0], values[..., 1:] = -9.0, 0.5
    views = photographs_of_ball(6)
    field = VoxelField(random_voxels().box, values, torch.full((3,), 0.5))
    exposures = torch.linspace(0.8, 1.2, 6)[:, None].expand(6, 3)
    grey = (127.5 * exposures[:, None, None].expand(views.images.shape)).to(torch.uint8)
    taken = replace(views, images=grey)
    field = replace(field, background=torch.zeros(3))
    alone = CarvingConfig(company=0)
    assert carve_free_space(field, taken, alone).any()
    assert not carve_free_space(field, correct_exposure(taken, exposures), alone).any()


def test_common_gains_are_those_of_whole_pictures() -> None:
    shown = torch.rand(4, 9, 7, 3, generator=torch.Generator().manual_seed(3))
    found = estimate_common_gains(GAINS.mean(1)[:, None, None, None] * shown, shown)
    torch.testing.assert_close(found, normalised(GAINS.mean(1)[:, None])[:, 0], atol=1e-4, rtol=0)
