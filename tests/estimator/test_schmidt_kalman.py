"""Schmidt-Kalman update: pictures in a field that errs alike in all of them."""

import torch

from nerfnav.estimator.core.belief import Belief
from nerfnav.estimator.map_error import add_consider_covariance, correct_schmidt_kalman
from nerfnav.robots import RandomAcceleration, RigidState

STILL = RigidState.at_rest((0.1, 0.2, 0.3)).map(lambda tensor: tensor.double())
NOISE = RandomAcceleration(0.1, 0.4, 0.6)


def spread(size: float, seed: int) -> torch.Tensor:
    root = torch.randn(12, 12, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)
    return size**2 * (root @ root.T / 12 + torch.eye(12))


def pose_alone(matrix: torch.Tensor) -> torch.Tensor:
    shows = torch.tensor([1.0, 1, 1, 0, 0, 0, 1, 1, 1, 0, 0, 0]).double()
    return shows[:, None] * matrix * shows


def test_a_picture_moves_the_state_as_one_with_the_noise_of_both_would() -> None:
    before, map_error = Belief(STILL, spread(0.02, 0)), pose_alone(spread(0.03, 1))
    measured, noise = pose_alone(spread(0.01, 2)), 1e-9 * torch.eye(12).double()
    shows = torch.eye(12).double()[[0, 1, 2, 6, 7, 8]]
    reported = shows @ measured @ shows.T
    difference = torch.tensor([1e-3, -2e-3, 1e-3, 0.0, 1e-3, 2e-3]).double()
    seen = add_consider_covariance(before, map_error)

    def corrected(covariance: torch.Tensor, error: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        gain = covariance @ shows.T @ torch.linalg.inv(shows @ covariance @ shows.T + error)
        return gain @ difference, covariance - gain @ shows @ covariance

    change, covariance = corrected(seen.covariance, reported)
    found = Belief(STILL.retract(change), covariance + noise)
    mine = correct_schmidt_kalman(found, before, map_error, NOISE)
    change, covariance = corrected(before.covariance, reported + shows @ map_error @ shows.T)
    torch.testing.assert_close(before.mean.local(mine.mean), change, rtol=0.02, atol=2e-5)
    torch.testing.assert_close(mine.covariance, covariance, rtol=0.01, atol=1e-7)


def test_without_such_errors_the_state_is_where_the_field_shows_it() -> None:
    change = torch.full((12,), 1e-3).double()
    before, found = Belief(STILL, spread(0.02, 0)), Belief(STILL.retract(change), spread(0.005, 3))
    mine = correct_schmidt_kalman(found, before, torch.zeros(12, 12), NOISE)
    torch.testing.assert_close(mine.mean.position, found.mean.position, rtol=0, atol=1e-6)
    torch.testing.assert_close(mine.covariance, found.covariance, rtol=1e-4, atol=1e-8)
