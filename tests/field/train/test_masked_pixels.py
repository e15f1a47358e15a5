"""Pixels that do not count: they are not learned, prove nothing, and do not judge a field."""

from dataclasses import replace

import pytest
import torch

from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.proof.carving import CarvingConfig, carve_free_space
from nerfnav.field.render.volume_rendering import render_image
from nerfnav.field.train.evaluation import calibrate_noise
from nerfnav.field.train.exposure import ExposureCorrection
from nerfnav.field.train.grid_learner import GridLearner
from nerfnav.field.train.rays import RaySampler
from nerfnav.geometry import PosedImages
from tests.field.fields import photographs_of_ball, random_voxels, random_voxels_in_a_room


def with_stranger(views: PosedImages) -> PosedImages:
    """The views with something red in a part of each picture, and a mask that leaves it out."""
    mask = torch.ones(views.images.shape[:3], dtype=torch.bool)
    for index in range(len(views)):
        mask[index, 3 : 12 + index, 2:14] = False
    images = torch.where(mask[..., None], views.images, torch.tensor([255, 0, 0], dtype=torch.uint8))
    return replace(views, images=images, mask=mask)


def rendered(field: VoxelField, count: int = 4, size: int = 32) -> PosedImages:
    views = photographs_of_ball(count, size)
    images = [render_image(field, views.camera, views.poses[index]).image for index in range(count)]
    return replace(views, images=torch.stack(images))


@pytest.mark.parametrize("patch", [1, 2, 3])
def test_masked_pixels_are_never_drawn(patch: int) -> None:
    taken = photographs_of_ball(4, 24)
    views = with_stranger(replace(taken, images=torch.zeros_like(taken.images)))
    batch = RaySampler(views, torch.Generator().manual_seed(0)).draw(3000, patch)
    assert len(batch.targets) > 1000 and batch.targets.max() == 0


def test_a_mask_and_the_pixels_that_are_asked_for_meet() -> None:
    views = with_stranger(photographs_of_ball(3, 24))
    assert views.mask is not None
    asked = torch.zeros_like(views.mask)
    asked[1, :8] = True
    sampler = RaySampler(views, torch.Generator().manual_seed(0), asked)
    places = {tuple(ray.tolist()) for ray in torch.from_numpy(sampler.draw(4000).directions)}
    assert len(places) == int((asked & views.mask).sum())


def test_the_gains_of_pictures_are_those_without_what_is_masked() -> None:
    field = random_voxels_in_a_room()
    views = rendered(field)
    mask = torch.rand(views.images.shape[:3], generator=torch.Generator().manual_seed(0)) > 0.5
    mask[1:] = True
    views = replace(views, images=torch.where(mask[..., None], views.images, views.images // 3))
    found = []
    for taken in (replace(views, mask=mask), views):
        sampler = RaySampler(taken, torch.Generator().manual_seed(0))
        ExposureCorrection(sampler, wanted=True).look(GridLearner.of(field, 1.0, workers=1), 0.5)
        found.append((sampler.gains - 1).abs().max().item())
    assert found[0] < 0.01 < found[1]


@pytest.mark.parametrize("exposure", [False, True])
def test_what_is_masked_does_not_judge(exposure: bool) -> None:
    field = random_voxels()
    views = with_stranger(rendered(field))
    blind = calibrate_noise(field.info, field, replace(views, mask=None), exposure)
    masked = calibrate_noise(field.info, field, views, exposure)
    assert blind.psnr_db is not None and masked.psnr_db is not None
    assert blind.psnr_db < 20 and masked.psnr_db > 45
    assert masked.noise_std is not None and masked.noise_std < 0.01


def test_what_is_masked_proves_nothing() -> None:
    """A thin grey box before a black background: pictures of it that disagree prove it free."""
    values = torch.zeros(9, 9, 9, 4)
    values[..., 0], values[..., 1:] = -9.0, 0.5
    field = VoxelField(random_voxels().box, values, torch.zeros(3))
    views = photographs_of_ball(6)
    shades = torch.linspace(60, 200, 6)[:, None, None, None].expand(views.images.shape)
    views = replace(views, images=shades.to(torch.uint8))
    alone = CarvingConfig(company=0)
    everything = carve_free_space(field, views, alone)
    mask = torch.ones(views.images.shape[:3], dtype=torch.bool)
    assert torch.equal(carve_free_space(field, replace(views, mask=mask), alone), everything)
    mask[0] = False
    assert everything.any() and carve_free_space(field, replace(views, mask=mask), alone).any()
    mask[:3] = False  # too few of the others disagree
    assert not carve_free_space(field, replace(views, mask=mask), alone).any()
