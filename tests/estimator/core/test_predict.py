"""Prediction by the dynamics."""

import torch

from nerfnav.estimator.core.belief import Belief
from nerfnav.estimator.core.prediction import predict, transition
from nerfnav.robots import StateNoise
from nerfnav.robots.state import RigidState
from tests.estimator.places import ROBOT, draws

DT = 0.1
SPINNING = RigidState.at_rest((0.2, -0.1, 0.3), 0.4).retract(0.5 * torch.randn(12, generator=draws(1)))
ACTION = torch.tensor([3.0, 1e-3, -2e-3, 1e-3])


def test_the_jacobian_agrees_with_finite_differences():
    state, action, h = SPINNING.to(torch.float64), ACTION.double(), 1e-6
    after, jacobian = transition(ROBOT, state, action, DT)

    def moved(tangent: torch.Tensor) -> torch.Tensor:
        return after.local(ROBOT.step(state.retract(tangent), action, DT))

    columns = [(moved(h * e) - moved(-h * e)) / (2 * h) for e in torch.eye(12, dtype=torch.float64)]
    torch.testing.assert_close(jacobian, torch.stack(columns, -1), atol=1e-8, rtol=1e-6)


def test_the_mean_takes_the_step_of_the_dynamics():
    belief = predict(Belief(SPINNING, 0.01 * torch.eye(12)), ACTION, ROBOT, DT, StateNoise())
    torch.testing.assert_close(belief.mean.position, ROBOT.step(SPINNING, ACTION, DT).position)


def test_the_covariance_is_that_of_a_cloud_of_robots():
    spread, noise = StateNoise(0.01, 0.02, 0.01, 0.02), StateNoise(0.005, 0.005, 0.005, 0.005)
    belief = predict(Belief(SPINNING, spread.covariance()), ACTION, ROBOT, DT, noise)
    count = 20000
    before, after = torch.randn(2, count, 12, generator=draws(2))
    cloud = SPINNING.map(lambda part: part.expand(count, *part.shape)).retract(spread.std() * before)
    cloud = ROBOT.step(cloud, ACTION.expand(count, -1), DT).retract(noise.std() * after)
    mean = belief.mean.map(lambda part: part.expand(count, *part.shape))
    scale = belief.covariance.diagonal().sqrt()
    seen = mean.local(cloud).T.cov() / scale / scale[:, None]
    torch.testing.assert_close(seen, belief.covariance / scale / scale[:, None], atol=0.04, rtol=0)


def test_what_is_uncertain_in_velocity_becomes_uncertain_in_position():
    spread = StateNoise(0.0, 0.1, 0.0, 0.0)
    still = StateNoise(0.0, 0.0, 0.0, 0.0)
    belief = predict(Belief(SPINNING, spread.covariance()), ACTION, ROBOT, DT, still)
    torch.testing.assert_close(belief.covariance[0, 0].sqrt(), torch.tensor(0.1 * DT))
    assert belief.covariance[0, 3] > 0
