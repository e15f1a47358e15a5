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

    A tenth of the time that automatic differentiation takes, for this is a few small operations.
    """
    after = robot.step(state, action, dt)
    tangents = _STEP * torch.cat([torch.eye(TANGENT), -torch.eye(TANGENT)]).double()
    moved = robot.step(_copies(state).retract(tangents), action.double().expand(2 * TANGENT, -1), dt)
    ahead, behind = _copies(after).local(moved).chunk(2)
    return after, ((ahead - behind) / (2 * _STEP)).T.to(state.position)


def predict(
    belief: Belief, action: Float[Tensor, " a"], robot: Robot, dt: float, noise: ProcessNoise
) -> Belief:
    """The belief after an action of `dt` [s], before any picture."""
    mean, jacobian = transition(robot, belief.mean.detach(), action.detach(), dt)
    covariance = jacobian @ belief.covariance @ jacobian.T + noise.covariance().to(jacobian)
    return Belief(mean, 0.5 * (covariance + covariance.T))


def _copies(state: RigidState) -> RigidState:
    return state.map(lambda tensor: tensor.double().expand(2 * TANGENT, *tensor.shape))
