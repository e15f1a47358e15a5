"""Where a field shows a camera, and where it is: errors of the field that come with every picture (Schmidt 1966).

A picture fits best at y = x (+) e, with x the true state and e ~ N(0, F) what the field is wrong by there (F in the
tangent, see map_error.py). So with x- ~ N(mu-, P), a filter that compares pictures is given S = P + F, and what it
finds, y+ ~ N(m, C), moves x by its regression on y:

    G = P S^-1,   mu+ = mu- (+) G (m (-) mu-),   P+ = P - G (S - C) G'

What is told of x+ is P+ + F: in the next picture the field is wrong by about the same, so that it does not average out.
"""

from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.estimator.core.belief import Belief
from nerfnav.estimator.core.covariance import POSE
from nerfnav.estimator.core.prediction import noise_scale
from nerfnav.geometry import so3
from nerfnav.robots import ProcessNoise

_TRUST = 1.5
"""How well the size of process noise is known beforehand: degrees of freedom (see prediction.py)."""
_Square = Float[Tensor, "12 12"]


def apparent(belief: Belief, floor: _Square) -> Belief:
    """Where the field should show what is believed."""
    return Belief(belief.mean, belief.covariance + floor)


def true_state(found: Belief, before: Belief, floor: _Square, noise: ProcessNoise) -> Belief:
    """x+, for what was found from `apparent(before, floor)`; `before` holds this process noise once."""
    change = before.mean.local(found.mean).double()
    held, spread = before.covariance.double(), found.covariance.double()
    shown = held + floor.double()
    pose = shown[POSE][:, POSE].inverse()
    told = spread[POSE][:, POSE].inverse() - pose
    size = max(1.0, noise_scale(change[POSE], pose, told, _TRUST))
    more = (size - 1) * noise.covariance().double()
    held, shown = held + more, shown + more
    gain = torch.linalg.solve(shown, held).T
    covariance = held - gain @ (shown - spread) @ gain.T
    mean = before.mean.retract((gain @ change).to(before.mean.position))
    mean = replace(mean, rotation=so3.project(mean.rotation))
    return Belief(mean, (0.5 * (covariance + covariance.T)).to(before.covariance))
