"""Where to begin a descent, when one beginning is not enough."""

import torch

from nerfnav.estimator.core.belief import Belief
from nerfnav.estimator.core.covariance import POSE
from nerfnav.estimator.newton import Guess
from nerfnav.estimator.photometric.residuals import Observation, residuals
from nerfnav.geometry import Pose, so3


def drawn(prediction: Belief, count: int, generator: torch.Generator) -> Pose:
    """The mean of a prediction, and random poses of it, batch shape (count + 1,)."""
    mean = prediction.mean
    root = torch.linalg.cholesky(prediction.covariance[POSE][:, POSE])
    draws = torch.randn(count, 6, generator=generator) @ root.T
    draws = torch.cat([torch.zeros(1, 6), draws])
    return Pose(so3.retract(mean.rotation.expand(len(draws), 3, 3), draws[:, 3:]), mean.position + draws[:, :3])


def likeliest(seen: Observation, poses: Pose, count: int, saturation: float = 1.0) -> Guess:
    """The first of the poses (n,) and, of the others, those whose view looks most like the picture.

    Colour differences above `saturation` [1 = full scale] count as this.
    """
    off = residuals(seen, poses).abs().clamp_max(saturation).mean((1, 2))
    best = off.argsort()[:count]
    return Guess.at(poses[torch.cat([torch.zeros(1, dtype=best.dtype), best[best != 0]])])
