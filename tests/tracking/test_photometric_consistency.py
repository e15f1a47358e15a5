"""How much a picture looks like the field."""

import pytest
import torch

from nerfnav.estimator.core.filter_step import FilterStep
from nerfnav.robots import RigidState
from nerfnav.tracking.photometric_consistency import PhotometricConsistency, UsualDifference

PIXELS = torch.stack(torch.meshgrid(torch.arange(20), torch.arange(10), indexing="xy"), -1).reshape(-1, 2)


def step(residual: torch.Tensor, pixels: torch.Tensor = PIXELS) -> FilterStep:
    return FilterStep(0, RigidState.at_rest((0.0, 0.0, 0.0)), 0.0, 0.0, pixels, residual)


def test_what_is_unexplained_is_a_share_of_the_pictures_own_variance() -> None:
    halves = torch.zeros(10, 20, 3, dtype=torch.uint8)
    halves[:, 10:] = 102  # 0.2 to either side of the mean
    share = PhotometricConsistency.of(step(torch.full((200,), 0.1)), halves)
    assert share is not None
    assert share.difference == pytest.approx(0.1) and share.unexplained == pytest.approx(0.25)


def test_where_nothing_was_compared_there_is_no_likeness() -> None:
    assert (
        PhotometricConsistency.of(step(torch.zeros(0), PIXELS[:0]), torch.zeros(10, 20, 3, dtype=torch.uint8)) is None
    )


def test_what_is_usual_is_what_the_last_pictures_were_and_no_more_than_was_told() -> None:
    usual = UsualDifference(0.05, 3)
    assert usual.difference == 0.05
    for difference in (0.01, 0.02, 0.03, 0.04):
        usual.add(difference)
    assert usual.difference == pytest.approx(0.03)
    usual.restart(0.08)
    assert usual.difference == pytest.approx(0.08)
    usual.add(0.02)
    assert usual.difference == pytest.approx(0.05)
