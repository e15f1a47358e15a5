"""The posterior covariance from the curvature of the cost."""

import torch

from nerfnav.estimator.core.belief import Curvature, hessian, posterior_covariance
from tests.estimator.places import draws

ROOT = torch.randn(12, 12, generator=draws(0)) + 4 * torch.eye(12)
PREDICTION = 1e-3 * ROOT @ ROOT.T


def test_the_hessian_of_a_quadratic_is_its_matrix():
    matrix = torch.randn(5, 5, generator=draws(1))
    curved = hessian(lambda x: x @ matrix @ x + x.sum(), torch.randn(5, generator=draws(2)))
    torch.testing.assert_close(curved, matrix + matrix.T)


def test_a_cost_of_the_process_term_alone_returns_the_prediction():
    covariance, curvature = posterior_covariance(2 * torch.linalg.inv(PREDICTION), PREDICTION)
    assert curvature is Curvature.EXACT
    torch.testing.assert_close(covariance, PREDICTION, atol=1e-6, rtol=1e-3)


def test_a_linear_measurement_gives_the_kalman_covariance():
    measured, variance = torch.randn(4, 12, generator=draws(3)), 1e-3
    cost = 2 * (torch.linalg.inv(PREDICTION) + measured.T @ measured / variance)
    covariance, _ = posterior_covariance(cost, PREDICTION)
    gain = PREDICTION @ measured.T @ torch.linalg.inv(measured @ PREDICTION @ measured.T + variance * torch.eye(4))
    torch.testing.assert_close(covariance, PREDICTION - gain @ measured @ PREDICTION, atol=1e-5, rtol=1e-2)


def test_a_hessian_that_is_not_convex_keeps_the_prediction_in_the_weak_direction():
    inverse = torch.linalg.inv(PREDICTION)
    weak = torch.zeros(12)
    weak[0] = 1.0
    cost = 2 * (inverse - 50 * inverse.max() * torch.outer(weak, weak))
    covariance, curvature = posterior_covariance(cost, PREDICTION)
    assert curvature is Curvature.CLIPPED
    assert torch.linalg.eigvalsh(covariance.double()).min() > 0
    assert covariance[0, 0] <= PREDICTION[0, 0] * 1.001
