"""Prediction: move the belief by the dynamics alone (paper Eqs. 3-4), and adapt the process noise to pictures.

    mu- = f(mu, u),   A = df/dx,   Sigma- = A Sigma A' + Q

A maps the tangent of mu to the tangent of mu-: f(mu (+) d, u) = mu- (+) (A d + O(d^2)).

The strength of the process noise is adapted by the innovation (Mehra 1970; Akhlaghi, Zhou and Huang 2017). Only the
pose shows in a picture. Its innovation d is almost the noise of one time step, for the pose before was known far
better than that. With H the picture's information and n the numbers of the pose that it determines, the scale s of Q
has the posterior mean

    s = (nu + d' (Sigma-_TT)^-1 d) / (nu + n),   n = tr H (H + (Sigma-_TT)^-1)^-1

with nu degrees of freedom of the prior on Q (inverse gamma). Velocity and body rate follow by
A Sigma A' + s Q: a kick that no noise explains moves them less, and a calm robot is soon surer of them.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.estimator.core.belief import Belief
from nerfnav.robots import TANGENT, ProcessNoise, RigidState, Robot


def estimate_noise_scale(
    change: Float[Tensor, "6"], predicted: Float[Tensor, "6 6"], seen: Float[Tensor, "6 6"], trust: float
) -> float:
    """Return s for a `change` of the pose; `predicted` and `seen` are informations, `trust` is nu > 0."""
    return (trust + (change @ predicted @ change).item()) / (trust + count_determined(predicted, seen))


def count_determined(predicted: Float[Tensor, "6 6"], seen: Float[Tensor, "6 6"]) -> float:
    """Return n, the numbers of the pose that a picture determines; `predicted` and `seen` are informations."""
    return torch.linalg.solve(predicted + seen, seen).trace().item()


def scale_process_noise(prediction: Belief, noise: Float[Tensor, "12 12"], scale: float) -> Belief:
    """Scale the process noise in a prediction that holds `noise` once."""
    return Belief(prediction.mean, prediction.covariance + (scale - 1) * noise)


_STEP = 1e-5
"""Of the differences, in each tangent number."""


def transition(
    robot: Robot, state: RigidState, action: Float[Tensor, " a"], dt: float
) -> tuple[RigidState, Float[Tensor, "12 12"]]:
    """Return the next state f(x, u) and A = df/dx there, by central differences of `robot.step` in double precision.

    A tenth of the time that automatic differentiation takes, for this is a few small operations: all states step
    together, the given one first.
    """
    apart = _STEP * torch.eye(TANGENT).double()
    tangents = torch.cat([torch.zeros_like(apart[:1]), apart, -apart])
    moved = robot.step(_copies(state, len(tangents)).retract(tangents), action.double().expand(len(tangents), -1), dt)
    ahead, behind = _copies(moved[0], 2 * TANGENT).local(moved[1:]).chunk(2)
    return moved[0].to(state.position), ((ahead - behind) / (2 * _STEP)).T.to(state.position)


def predict(belief: Belief, action: Float[Tensor, " a"], robot: Robot, dt: float, noise: ProcessNoise) -> Belief:
    """Return the belief after an action of `dt` [s], before any picture."""
    mean, jacobian = transition(robot, belief.mean.detach(), action.detach(), dt)
    covariance = jacobian @ belief.covariance @ jacobian.T + noise.covariance().to(jacobian)
    return Belief(mean, 0.5 * (covariance + covariance.T))


def _copies(state: RigidState, count: int) -> RigidState:
    return state.map(lambda tensor: tensor.double().expand(count, *tensor.shape))
