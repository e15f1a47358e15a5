"""Noise on states."""

import pytest
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.robots import StateNoise
from tests.estimator.places import draws


def test_the_defaults_are_the_papers_two_centimetres_and_half_on_the_rates():
    assert StateNoise().std().tolist() == pytest.approx([0.02] * 3 + [0.01] * 3 + [0.02] * 3 + [0.01] * 3)


def test_samples_spread_as_the_covariance_says():
    noise, generator = StateNoise(0.1, 0.2, 0.3, 0.4), draws(0)
    samples = torch.stack([noise.sample(generator) for _ in range(4000)])
    torch.testing.assert_close(samples.T.cov(), noise.covariance(), atol=0.01, rtol=0.1)


def test_isotropic_noise_has_the_variance_asked_for():
    torch.testing.assert_close(StateNoise.isotropic(0.1).covariance(), 0.1 * torch.eye(12))


@pytest.mark.parametrize("wrong", [-0.1, float("nan"), float("inf")])
def test_a_standard_deviation_that_is_none_is_refused(wrong: float):
    with pytest.raises(InvalidInputError, match="at least 0"):
        StateNoise(position_m=wrong)
