"""Trial of the basin experiment: one correction of a belief that is off."""

import math
import time

import torch
from torch import Tensor

from nerfnav.estimator import Belief, FilterOutcome, StateNoise
from nerfnav.experiments.arena import Arena
from nerfnav.experiments.basin_results import CONVERGED
from nerfnav.experiments.fast_filter import fast_filter
from nerfnav.experiments.study import Row
from nerfnav.robots import ATTITUDE, POSITION, TANGENT, RigidState

_MOVING = (0.1, 0.1)
"""Spread of the prior's velocity [m/s] and body rate [rad/s]."""


def prior(truth: RigidState, size: tuple[float, float], generator: torch.Generator) -> Belief:
    """A belief whose mean is off by exactly so much [m, rad], and whose covariance says so."""
    way, axis = torch.nn.functional.normalize(torch.randn(2, 3, generator=generator), dim=-1)
    error = torch.zeros(TANGENT)
    error[POSITION], error[ATTITUDE] = size[0] * way, size[1] * axis
    spread = StateNoise(size[0] / math.sqrt(3), _MOVING[0], size[1] / math.sqrt(3), _MOVING[1])
    return Belief(truth.retract(error), spread.covariance())


def corrected(
    arena: Arena, seen: tuple[RigidState, Tensor], size: tuple[float, float], generator: torch.Generator
) -> Row:
    truth, image = seen
    belief = prior(truth, size, generator)
    begun = time.perf_counter()
    *_, last = fast_filter(arena).correct(belief, image, generator)
    ms = 1e3 * (time.perf_counter() - begun)
    assert last.posterior is not None, "the last step of an estimator has the posterior"
    error = last.posterior.mean.local(truth)
    errors = {
        "position_m": error[POSITION].norm().item(),
        "rotation_deg": math.degrees(error[ATTITUDE].norm().item()),
    }
    converged = all(errors[name] < bound for name, bound in CONVERGED.items())
    outcome = (last.outcome or FilterOutcome.UPDATED).name.lower()
    return {"error_m": size[0], "error_rad": size[1]} | errors | {"converged": converged, "outcome": outcome, "ms": ms}
