"""J of Eq. 6 and its exact second derivatives."""

from dataclasses import replace

import pytest
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.estimator.core.belief import Belief
from nerfnav.estimator.paper.cost import PoseCost
from nerfnav.estimator.photometric.residuals import ColorNoise
from nerfnav.field.models.analytic import BallsField
from nerfnav.robots.state import RigidState
from tests.estimator.places import COLOR_STD, HERE, cost_at, near


def in_double(cost: PoseCost) -> PoseCost:
    """The same cost in float64, for finite differences."""
    field = cost.observation.field
    assert isinstance(field, BallsField)
    field = replace(field, centers=field.centers.double(), radii=field.radii.double())
    seen = cost.observation
    seen = replace(seen, field=field, mount=seen.mount.to(torch.float64), colors=seen.colors.double())
    return PoseCost.of(seen, cost.prediction.to(torch.float64), cost.noise)


def test_the_hessian_agrees_with_finite_differences():
    everything = ColorNoise(std=COLOR_STD, alike=1.0, outlier_deviations=float("inf"))
    cost = in_double(cost_at(HERE, near(HERE, 0), everything))
    state, h = cost.prediction.mean.retract(0.005 * torch.ones(12, dtype=torch.float64)), 1e-5
    samples = cost.observation.samples(state)

    def gradient(tangent: torch.Tensor) -> torch.Tensor:
        tangent = tangent.requires_grad_()
        moved = state.retract(tangent)
        residual = cost.observation.residual(moved, samples)
        total = residual.square().sum() / COLOR_STD**2 + cost.process(moved)
        return torch.autograd.grad(total, tangent)[0]

    rows = [(gradient(h * e) - gradient(-h * e)) / (2 * h) for e in torch.eye(12, dtype=torch.float64)]
    expected = torch.stack(rows)
    torch.testing.assert_close(cost.hessian(state), expected, atol=1e-4 * expected.abs().max().item(), rtol=1e-4)


def test_the_process_term_is_the_squared_mahalanobis_distance():
    belief = Belief(HERE, torch.diag(torch.linspace(0.01, 0.1, 12)))
    offset = torch.linspace(-0.1, 0.1, 12)
    cost = cost_at(HERE, belief)
    expected = (offset.square() / torch.linspace(0.01, 0.1, 12)).sum()
    torch.testing.assert_close(cost.process(HERE.retract(offset)), expected, rtol=1e-4, atol=0)


def test_the_total_is_the_sum_of_both_terms_and_least_near_the_truth():
    cost = cost_at(HERE, near(HERE, 1))
    at_truth, away = cost.terms(HERE), cost.terms(HERE.retract(torch.full((12,), 0.03)))
    torch.testing.assert_close(at_truth.total, at_truth.photometric + at_truth.process)
    assert at_truth.photometric < 0.05 * away.photometric


@pytest.mark.parametrize("covariance", [torch.zeros(12, 12), torch.full((12, 12), float("nan"))])
def test_what_is_no_covariance_is_refused(covariance: torch.Tensor):
    with pytest.raises(InvalidInputError, match="positive definite"):
        cost_at(HERE, Belief(RigidState.at_rest((0.0, 0.0, 0.2)), covariance))
