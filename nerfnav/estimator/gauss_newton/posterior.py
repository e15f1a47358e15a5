"""Posteriors of two hypotheses, told as one Gaussian of the mixture's moments.

    mean m = sum w_i m_i,   covariance sum w_i (Sigma_i + (m_i - m) (m_i - m)')

(Bar-Shalom, Li, Kirubarajan, "Estimation with applications to tracking and navigation", 2001, section 1.4.16.)
"""

import math
from dataclasses import replace

import torch

from nerfnav.estimator.core.belief import Belief
from nerfnav.estimator.core.filter_step import FilterOutcome, FilterStep
from nerfnav.geometry import so3

_CONSISTENT = 12.6
"""Process term above which a minimum is hardly where the prediction says: chi-squared of six numbers, once in 20."""
_LARGEST = 50.0
"""Logarithm of odds beyond which there is nothing to share."""


def unexplained(step: FilterStep, before: Belief) -> FilterStep:
    """The posterior where a search has found nothing that explains the picture: a false minimum, as likely as not.

    The picture is then as likely to have told what the minimum says as to have told nothing, so that the prediction
    `before` has half of the weight. A minimum where the prediction would hardly be is no such thing, and is left.
    """
    assert step.posterior is not None, "a concluded step has the posterior"
    found = step.posterior
    if step.process > _CONSISTENT:
        return replace(step, mean=before.mean, posterior=before, outcome=FilterOutcome.WEAK)
    away = found.mean.local(before.mean)
    covariance = 0.5 * (found.covariance + before.covariance) + 0.25 * torch.outer(away, away)
    mean = found.mean.retract(0.5 * away)
    mean = replace(mean, rotation=so3.project(mean.rotation))
    return replace(step, mean=mean, posterior=Belief(mean, covariance), outcome=FilterOutcome.WEAK)


def rivalled(step: FilterStep, rival: FilterStep, doubt: float) -> FilterStep:
    """The posterior where there is another minimum, which a picture of little does not rule out.

    Both are as likely as Laplace's approximation makes them, exp(-J / 2) |Sigma|^(1 / 2), with the photometric part of
    J divided by how many times less the picture tells, `doubt`. The belief stays at the better minimum, with the second
    moment of both about it.
    """
    assert step.posterior is not None and rival.posterior is not None, "concluded steps have posteriors"
    best, other = step.posterior, rival.posterior
    logs = [
        0.5 * float(belief.covariance.double().logdet() - end.photometric / doubt - end.process)
        for belief, end in ((best, step), (other, rival))
    ]
    share = 1 / (1 + math.exp(min(logs[0] - logs[1], _LARGEST)))
    away = best.mean.local(other.mean)
    moment = other.covariance + torch.outer(away, away)
    return replace(step, posterior=replace(best, covariance=(1 - share) * best.covariance + share * moment))
