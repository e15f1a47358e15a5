"""Prediction: the belief moved by the dynamics alone (paper Eqs. 3-4).

    mu- = f(mu, u),   A = df/dx,   Sigma- = A Sigma A' + Q

A maps the tangent of mu to the tangent of mu-: f(mu (+) d, u) = mu- (+) (A d + O(d^2)).
"""

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.estimator.belief import Belief
from nerfnav.estimator.noise import ProcessNoise
from nerfnav.robots import TANGENT, RigidState, Robot

_STEP = 1e-5
"""Of the differences, in each tangent number."""


def transition(
    robot: Robot, state: RigidState, action: Float[Tensor, " a"], dt: float
) -> tuple[RigidState, Float[Tensor, "12 12"]]:
    """The next state f(x, u) and A = df/dx there, by central differences of `robot.step` in double precision.

    A tenth of the time that automatic differentiation takes, for this is a few small operations: all states step
    together, the given one first.
    """
    apart = _STEP * torch.eye(TANGENT).double()
    tangents = torch.cat([torch.zeros_like(apart[:1]), apart, -apart])
    moved = robot.step(_copies(state, len(tangents)).retract(tangents), action.double().expand(len(tangents), -1), dt)
    ahead, behind = _copies(moved[0], 2 * TANGENT).local(moved[1:]).chunk(2)
    after = moved[0].map(lambda tensor: tensor.to(state.position))
    return after, ((ahead - behind) / (2 * _STEP)).T.to(state.position)


def predict(
    belief: Belief, action: Float[Tensor, " a"], robot: Robot, dt: float, noise: ProcessNoise
) -> Belief:
    """The belief after an action of `dt` [s], before any picture."""
    mean, jacobian = transition(robot, belief.mean.detach(), action.detach(), dt)
    covariance = jacobian @ belief.covariance @ jacobian.T + noise.covariance().to(jacobian)
    return Belief(mean, 0.5 * (covariance + covariance.T))


def _copies(state: RigidState, count: int) -> RigidState:
    return state.map(lambda tensor: tensor.double().expand(count, *tensor.shape))
