"""How strong the process noise really was: adaptation by the innovation (Mehra 1970; Akhlaghi, Zhou and Huang 2017).

Only the pose shows, and its innovation d is almost the noise of one time step, for the pose before was known far better
than that. With Sigma- = A Sigma A' + Q assumed, H the picture's information and n the numbers of the pose that
it tells, the scale s of Q has the posterior mean

    s = (nu + d' (Sigma-_TT)^-1 d) / (nu + n),   n = tr H (H + (Sigma-_TT)^-1)^-1

with nu degrees of freedom of what is known of Q beforehand (inverse gamma). Velocity and body rate follow by A Sigma A'
+ s Q: a kick that no noise explains moves them less, and a calm robot is soon surer of them.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.estimator.core.belief import Belief


def noise_scale(
    change: Float[Tensor, "6"], predicted: Float[Tensor, "6 6"], seen: Float[Tensor, "6 6"], trust: float
) -> float:
    """s, for the pose's `change` from the prediction; `predicted` and `seen` are informations, `trust` is nu > 0."""
    told = torch.linalg.solve(predicted + seen, seen).trace().item()
    return (trust + (change @ predicted @ change).item()) / (trust + told)


def with_noise_scaled(prediction: Belief, noise: Float[Tensor, "12 12"], scale: float) -> Belief:
    """A prediction that holds the process noise `noise` once, as if it held it `scale` times."""
    return Belief(prediction.mean, prediction.covariance + (scale - 1) * noise)
