"""Where a position is with a probability of 95 %."""

import pytest
import torch

from nerfnav.geometry.ellipsoid import ellipsoid_95

FACTORS = 0.1 * torch.randn(4, 3, 3, generator=torch.Generator().manual_seed(1))
COVARIANCES = FACTORS @ FACTORS.transpose(-1, -2)


def test_ellipsoids_are_as_large_as_the_covariance_says() -> None:
    axes, half = ellipsoid_95(COVARIANCES)
    shape = axes * half[..., None, :]
    expected = 2.7955**2 * COVARIANCES.double()
    torch.testing.assert_close(shape @ shape.transpose(-1, -2), expected, rtol=1e-5, atol=1e-8)
    assert (torch.linalg.det(axes) > 0).all()
    torch.testing.assert_close(axes @ axes.transpose(-1, -2), torch.eye(3).double().expand(4, 3, 3))


def test_nineteen_of_twenty_draws_lie_in_the_ellipsoid() -> None:
    draws = FACTORS[0] @ torch.randn(3, 50_000, generator=torch.Generator().manual_seed(2))
    axes, half = ellipsoid_95(COVARIANCES[0])
    inside = ((axes.T @ draws.double()) / half[:, None]).square().sum(0) <= 1
    assert inside.double().mean().item() == pytest.approx(0.95, abs=0.005)


def test_what_is_certain_has_axes_without_length() -> None:
    axes, half = ellipsoid_95(-1e-9 * torch.eye(3))
    assert half.tolist() == [0, 0, 0]
    assert axes.isfinite().all()
