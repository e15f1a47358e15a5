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


def transition(
    robot: Robot, state: RigidState, action: Float[Tensor, " a"], dt: float
) -> tuple[RigidState, Float[Tensor, "12 12"]]:
    """The next state f(x, u) and A = df/dx there, by automatic differentiation of `robot.step`."""
    # Twelve copies of the state, one for each row of A: a single backward pass gives all rows.
    tangents = torch.zeros(TANGENT, TANGENT, dtype=state.position.dtype, requires_grad=True)
    with torch.enable_grad():
        moved = robot.step(_copies(state).retract(tangents), action.expand(TANGENT, -1), dt)
        after = moved[0].detach()
        rows = _copies(after).local(moved)
        (jacobian,) = torch.autograd.grad(rows.diagonal().sum(), tangents)
    return after, jacobian


def predict(
    belief: Belief, action: Float[Tensor, " a"], robot: Robot, dt: float, noise: ProcessNoise
) -> Belief:
    """The belief after an action of `dt` [s], before any picture."""
    mean, jacobian = transition(robot, belief.mean.detach(), action.detach(), dt)
    covariance = jacobian @ belief.covariance @ jacobian.T + noise.covariance().to(jacobian)
    return Belief(mean, 0.5 * (covariance + covariance.T))


def _copies(state: RigidState) -> RigidState:
    return state.map(lambda tensor: tensor.expand(TANGENT, *tensor.shape))
