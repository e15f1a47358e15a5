"""Adam on the manifold."""

from dataclasses import replace

import pytest
import torch

from nerfnav.estimator.core.filter_config import DescentConfig
from nerfnav.estimator.paper.adam import descend
from nerfnav.estimator.paper.retraction import retract
from nerfnav.robots import StateNoise
from tests.estimator.places import HERE, cost_at, near

QUICK = DescentConfig(iterations=60, position_rate=3e-3, attitude_rate=3e-3)


def test_the_descent_starts_where_it_is_told_and_ends_near_the_truth():
    prediction = near(HERE, 0)
    states = list(descend(cost_at(HERE, prediction), prediction.mean, QUICK, retract))
    assert len(states) == QUICK.iterations + 1
    assert torch.equal(states[0][0].position, prediction.mean.position)
    first, last = (HERE.local(state) for state, _ in (states[0], states[-1]))
    assert last[:3].norm() < 0.2 * first[:3].norm()
    assert last[6:9].norm() < first[6:9].norm()


def test_every_state_on_the_way_is_on_the_manifold():
    prediction = near(HERE, 1)
    for state, _ in descend(cost_at(HERE, prediction), prediction.mean, QUICK, retract):
        torch.testing.assert_close(state.rotation @ state.rotation.T, torch.eye(3), atol=1e-6, rtol=0)


def test_the_cost_of_the_last_state_is_much_lower():
    prediction = near(HERE, 2)
    totals = [terms.total.item() for _, terms in descend(cost_at(HERE, prediction), prediction.mean, QUICK, retract)]
    assert totals[-1] < 0.2 * totals[0]


def test_a_descent_that_has_settled_stops_early_if_allowed():
    prediction = near(HERE, 3)
    config = DescentConfig(iterations=200, final_rate=0.01, stop_change=2e-3)
    states = list(descend(cost_at(HERE, prediction), prediction.mean, config, retract))
    assert config.stop_window < len(states) < 201


@pytest.mark.slow
def test_velocity_follows_position_through_the_cross_covariance():
    prediction = near(HERE, 4)
    covariance = prediction.covariance.clone()
    covariance[0, 3] = covariance[3, 0] = 0.9 * covariance[0, 0]
    cost = cost_at(HERE, type(prediction)(prediction.mean, covariance))
    config = DescentConfig(iterations=150)
    *_, (state, _) = descend(cost, prediction.mean, config, retract)
    moved = prediction.mean.local(state)
    torch.testing.assert_close(moved[3], 0.9 * moved[0], atol=1e-3, rtol=0.1)


@pytest.mark.slow
def test_in_a_single_tangent_plane_the_first_step_is_the_same_and_the_truth_is_found_too():
    prediction = near(HERE, 5)
    cost = cost_at(HERE, prediction)
    single = replace(QUICK, recursive=False)
    one, other = (list(descend(cost, prediction.mean, config, retract)) for config in (QUICK, single))
    torch.testing.assert_close(one[1][0].rotation, other[1][0].rotation)
    assert HERE.local(other[-1][0])[:3].norm() < 0.2 * HERE.local(prediction.mean)[:3].norm()


def test_a_single_tangent_plane_is_bent_where_the_attitude_turns_far():
    start = near(HERE.retract(0.5 * torch.eye(12)[8]), 6, StateNoise(0.3, 0.3, 0.3, 0.3))
    cost = cost_at(HERE, start)
    config = DescentConfig(iterations=25, attitude_rate=0.05, final_rate=1.0)
    one, other = (
        [state for state, _ in descend(cost, start.mean, replace(config, recursive=recursive), retract)]
        for recursive in (True, False)
    )
    torch.testing.assert_close(one[1].rotation, other[1].rotation)
    assert one[-1].local(other[-1])[6:9].norm() > 1e-3
