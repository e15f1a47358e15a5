"""Which pixels are compared."""

import torch

from nerfnav.estimator.pixels import PixelConfig, PixelSource, choose_pixels, feature_mask
from tests.estimator.places import draws


def checkers(height: int, width: int) -> torch.Tensor:
    """A grey picture with a patch of black and white squares in its right half."""
    image = torch.full((height, width, 3), 128, dtype=torch.uint8)
    v, u = torch.meshgrid(torch.arange(height), torch.arange(width), indexing="ij")
    board = ((u // 8 + v // 8) % 2 * 255).to(torch.uint8)
    patch = (u >= width // 2 + 8) & (v >= 16) & (v < height - 16) & (u < width - 16)
    return torch.where(patch[..., None], board[..., None], image)


def test_pixels_lie_around_features():
    image = checkers(96, 160)
    choice = choose_pixels(image, PixelConfig(count=64), draws(0))
    assert choice.source is PixelSource.FEATURES
    assert choice.pixels.shape == (64, 2)
    assert (choice.pixels[:, 0] > 80).all()
    assert feature_mask(image, PixelConfig())[choice.pixels[:, 1], choice.pixels[:, 0]].all()


def test_a_larger_dilation_offers_more_pixels():
    small, large = (feature_mask(checkers(96, 160), PixelConfig(dilation_px=size)).sum() for size in (3, 9))
    assert large > 2 * small


def test_all_pixels_are_different():
    choice = choose_pixels(checkers(96, 160), PixelConfig(count=200), draws(0))
    assert len(choice.pixels.unique(dim=0)) == 200


def test_too_few_features_are_filled_up_from_the_whole_picture():
    choice = choose_pixels(checkers(96, 160), PixelConfig(count=12_000, dilation_px=3), draws(0))
    assert choice.source is PixelSource.FILLED
    assert len(choice.pixels) == 12_000
    assert (choice.pixels[:, 0] < 80).any()


def test_a_picture_without_features_is_sampled_everywhere():
    choice = choose_pixels(torch.full((40, 60, 3), 90, dtype=torch.uint8), PixelConfig(count=500), draws(0))
    assert choice.source is PixelSource.UNIFORM
    assert choice.pixels[:, 0].max() > 50 and choice.pixels[:, 1].max() > 30
    assert choice.pixels[:, 0].max() < 60 and choice.pixels[:, 1].max() < 40


def test_a_picture_smaller_than_asked_gives_all_its_pixels():
    choice = choose_pixels(torch.zeros(5, 7, 3, dtype=torch.uint8), PixelConfig(count=256), draws(0))
    assert len(choice.pixels.unique(dim=0)) == 35


def test_the_same_seed_draws_the_same_pixels():
    first, second = (choose_pixels(checkers(96, 160), PixelConfig(), draws(3)).pixels for _ in range(2))
    assert torch.equal(first, second)
