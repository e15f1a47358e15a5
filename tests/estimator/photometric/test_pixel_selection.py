"""Which pixels are compared."""

from dataclasses import replace

import pytest
import torch
from jaxtyping import Float, Int
from torch import Tensor

from nerfnav.estimator.photometric.pixel_selection import (
    PixelChoice,
    PixelConfig,
    PixelDraw,
    PixelSource,
    choose_pixels,
    draw_by_information,
    feature_mask,
)
from nerfnav.estimator.photometric.residuals import FieldCamera, Observation
from nerfnav.geometry.camera import FORWARD_MOUNT
from tests.estimator.places import CAMERA, HERE, balls, draws, picture

VIEW = FieldCamera(balls(), CAMERA, FORWARD_MOUNT)


def slopes(pixels: Int[Tensor, "m 2"]) -> Float[Tensor, "m 3 6"]:
    return Observation.slopes(HERE.pose, VIEW, pixels)


def choose(image: Tensor, config: PixelConfig, seed: int = 0) -> PixelChoice:
    return choose_pixels(image, config, draws(seed), slopes)


def checkers(height: int, width: int) -> torch.Tensor:
    """A grey picture with a patch of black and white squares in its right half."""
    image = torch.full((height, width, 3), 128, dtype=torch.uint8)
    v, u = torch.meshgrid(torch.arange(height), torch.arange(width), indexing="ij")
    board = ((u // 8 + v // 8) % 2 * 255).to(torch.uint8)
    patch = (u >= width // 2 + 8) & (v >= 16) & (v < height - 16) & (u < width - 16)
    return torch.where(patch[..., None], board[..., None], image)


def test_pixels_lie_around_features():
    image = checkers(96, 160)
    choice = choose(image, PixelConfig(count=64))
    assert choice.source is PixelSource.FEATURES
    assert choice.pixels.shape == (64, 2)
    assert (choice.pixels[:, 0] > 80).all()
    assert feature_mask(image, PixelConfig())[choice.pixels[:, 1], choice.pixels[:, 0]].all()


@pytest.mark.parametrize("draw", PixelDraw)
@pytest.mark.parametrize("count", [64, 10**6])
def test_hidden_pixels_are_never_chosen(draw: PixelDraw, count: int) -> None:
    image, hidden = picture(balls(), HERE), torch.zeros(CAMERA.height, CAMERA.width, dtype=torch.bool)
    hidden[:, CAMERA.width // 3 :] = True
    choice = choose_pixels(image, PixelConfig(count=count, draw=draw), draws(0), slopes, hidden)
    assert not hidden[choice.pixels[:, 1], choice.pixels[:, 0]].any()
    assert len(choice.pixels.unique(dim=0)) == min(count, int((~hidden).sum()))


def test_a_larger_dilation_offers_more_pixels():
    small, large = (feature_mask(checkers(96, 160), PixelConfig(dilation_px=size)).sum() for size in (3, 9))
    assert large > 2 * small


def test_all_pixels_are_different():
    choice = choose(checkers(96, 160), PixelConfig(count=200))
    assert len(choice.pixels.unique(dim=0)) == 200


def test_too_few_features_are_filled_up_from_the_whole_picture():
    choice = choose(checkers(96, 160), PixelConfig(count=12_000, dilation_px=3))
    assert choice.source is PixelSource.FILLED
    assert len(choice.pixels) == 12_000
    assert (choice.pixels[:, 0] < 80).any()


def test_a_picture_without_features_is_sampled_everywhere():
    choice = choose(torch.full((40, 60, 3), 90, dtype=torch.uint8), PixelConfig(count=500))
    assert choice.source is PixelSource.UNIFORM
    assert choice.pixels[:, 0].max() > 50 and choice.pixels[:, 1].max() > 30
    assert choice.pixels[:, 0].max() < 60 and choice.pixels[:, 1].max() < 40


def test_a_picture_smaller_than_asked_gives_all_its_pixels():
    choice = choose(torch.zeros(5, 7, 3, dtype=torch.uint8), PixelConfig(count=256))
    assert len(choice.pixels.unique(dim=0)) == 35
    assert choice.source is PixelSource.ALL


def test_the_same_seed_draws_the_same_pixels():
    first, second = (choose(checkers(96, 160), PixelConfig(), 3).pixels for _ in range(2))
    assert torch.equal(first, second)


@pytest.mark.parametrize("draw", PixelDraw)
def test_as_many_different_pixels_as_asked_are_drawn_in_every_way(draw: PixelDraw):
    choice = choose(picture(balls(), HERE), PixelConfig(count=90, draw=draw))
    assert choice.pixels.shape == (90, 2)
    assert len(choice.pixels.unique(dim=0)) == 90


def test_pixels_drawn_by_information_tell_more_about_the_pose_than_pixels_drawn_evenly():
    config = PixelConfig(count=60, candidates=4)
    told = {}
    for draw in (PixelDraw.INFORMATION, PixelDraw.UNIFORM):
        flat = slopes(choose(picture(balls(), HERE), replace(config, draw=draw)).pixels).double().flatten(0, 1)
        told[draw] = torch.logdet(flat.T @ flat).item()
    assert told[PixelDraw.INFORMATION] > told[PixelDraw.UNIFORM] + 1


def test_the_only_pixel_that_tells_of_a_direction_is_always_drawn():
    told = torch.randn(200, 3, 6, generator=draws(0))
    told[:, :, 5] = 0
    told[137, :, 5] = 1.0
    drawn = [137 in draw_by_information(told, 20, draws(seed)).tolist() for seed in range(30)]
    assert sum(drawn) >= 28


def test_pixels_that_tell_nothing_at_all_are_drawn_evenly_and_not_refused():
    kept = draw_by_information(torch.zeros(50, 3, 6), 20, draws(0))
    assert len(kept.unique()) == 20
