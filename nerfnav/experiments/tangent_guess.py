"""First guesses of the comparison of tangent planes: a wrong pose, and the cost of what the field shows from the right
one."""

from dataclasses import replace

import torch

from nerfnav.estimator import Belief, ColorNoise, Observation, StateNoise
from nerfnav.estimator.cost import PoseCost
from nerfnav.estimator.pyramid import View
from nerfnav.experiments.arena import Arena
from nerfnav.experiments.views import held_out_poses
from nerfnav.field import levels_of
from nerfnav.geometry import FORWARD_MOUNT
from nerfnav.robots import ATTITUDE, CAMERA, POSITION, TANGENT, RigidState

_PIXELS, _HALVINGS = 128, 3
_OFF = 0.02
"""Error of the first position, along each axis [m]."""


def first_guess(arena: Arena, seed: int, error_rad: float) -> tuple[RigidState, RigidState, PoseCost]:
    """Truth, a state whose attitude is off by an angle, and the cost of states around it."""
    generator = torch.Generator().manual_seed(seed)
    truth = held_out_poses(arena, 1, seed)[0]
    view = View(levels_of(arena.field, 1 + _HALVINGS), CAMERA, FORWARD_MOUNT).at(_HALVINGS)
    pixels = view[1].pixels()
    pixels = pixels[torch.randperm(len(pixels), generator=generator)[:_PIXELS]]
    seen = Observation(*view, pixels, torch.zeros(len(pixels), 3))
    seen = replace(seen, colors=seen.shown(truth.pose.map(lambda tensor: tensor[None]))[0])
    error = torch.zeros(TANGENT)
    error[POSITION] = _OFF * torch.randn(3, generator=generator)
    error[ATTITUDE] = error_rad * torch.nn.functional.normalize(torch.randn(3, generator=generator), dim=0)
    wide = StateNoise(_OFF, _OFF, error_rad, _OFF)
    prediction = Belief(truth.retract(error), wide.covariance())
    return truth, prediction.mean, PoseCost.of(seen, prediction, ColorNoise(alike=1.0))  # without noise: to be matched
