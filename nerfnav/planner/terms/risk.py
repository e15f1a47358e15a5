"""Risk term: the collisions to be expected of the noise to come; not in Eq. 2.

    sum_t c_t(p_t, yaw_t)        c_t of risk/collision_map.py; the mean over the way of each step

counts the steps in which the robot will be pushed into something: plans keep wider of what is solid, pass a strait in
few steps, and leave the ground early. It is soft: where there is no wider way the least dangerous is taken.

When the arrival is put off at each step (a receding horizon that has reached its shortest), a sum over steps would be
least for a robot that waits outside of a strait for ever. There the same counts by way, sum_t c_t s_t / pace, with
s_t the way of the step: waiting neither costs nor helps.
"""

import math

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.geometry import so3
from nerfnav.planner.kernels import terms as kernels
from nerfnav.planner.risk.collision_map import NONE, ChanceGrid, CollisionMap
from nerfnav.planner.terms.term import Adjoint, CostTerm, Kernel, TermContext
from nerfnav.robots import FlatMap, Motion, wrap_angle


def risk(context: TermContext, motion: Motion) -> Float[Tensor, "*batch"]:
    """Collisions to be expected [1]."""
    if context.weights.risk == 0:
        return motion.actions.new_zeros(motion.actions.shape[:-2])
    position, parts, pace = motion.states.position, context.weights.samples_per_step, context.risk_context.pace
    fractions = ((torch.arange(parts) + 0.5) / parts).to(position)
    danger = CollisionMap.of(context.field, context.robot, context.risk_context)
    turns, way = danger.chances.shape[1] > 1, position.diff(dim=-2)
    heading = so3.yaw_of(motion.states.rotation) if turns else torch.zeros_like(position[..., 0])
    along = position[..., :-1, None, :] + fractions[:, None] * way[..., None, :]
    turned = heading[..., :-1, None] + fractions * wrap_angle(heading.diff(dim=-1))[..., None]
    first = len(danger.chances) - 1  # steps of their own chances
    steps = [*along[..., :first, :, :].unbind(-3), along[..., first:, :, :]]
    headings = [*turned[..., :first, :].unbind(-2), turned[..., first:, :]]
    found = [_chance(danger, step, *at) for step, at in enumerate(zip(steps, headings, strict=True))]
    chance = torch.cat([part.reshape(*along.shape[:-3], -1, parts) for part in found], -2).mean(-1)
    if pace is not None:
        chance = chance * (way.square().sum(-1) + kernels.STANDSTILL).sqrt() / pace
    return chance.sum(-1)


def _chance(
    danger: CollisionMap, step: int, points: Float[Tensor, "*batch 3"], headings: Float[Tensor, "*batch"]
) -> Float[Tensor, "*batch"]:
    """c_t at points of the world [m] with headings [rad]."""
    layers, lower, per_meter = (torch.from_numpy(part).to(points) for part in danger.parts)
    chances = layers[min(step, len(layers) - 1)]
    count, last = len(chances), torch.tensor(chances.shape[1:]).to(points) - 1
    at = (points - lower) * per_meter
    flat = (2 * at / last - 1).reshape(1, -1, 1, 1, 3).flip(-1)  # grid_sample counts axes from the last
    found = torch.nn.functional.grid_sample(chances[None], flat, padding_mode="border", align_corners=True)
    turn = headings.reshape(1, -1) / math.pi % 1 * count
    below = turn.detach().long().clamp_max(count - 1)
    first, second = (found.reshape(count, -1).gather(0, index % count)[0] for index in (below, below + 1))
    chance = (first + (turn - below)[0] * (second - first)).reshape(headings.shape)
    inside = ((at >= 0) & (at <= last)).all(-1)
    return torch.where(inside, chance, torch.zeros_like(at[..., 0]))


def chance_grid_of(context: TermContext) -> tuple[ChanceGrid, float]:
    """What the compiled twin asks for: the map, and 1 / pace, or 0 where each step counts once."""
    if context.weights.risk == 0:
        return NONE, 0.0
    pace = context.risk_context.pace
    danger = CollisionMap.of(context.field, context.robot, context.risk_context).parts
    return danger, 0.0 if pace is None else 1 / pace


def risk_kernel(context: TermContext, weight: float) -> Kernel:
    """The compiled twin."""
    danger, by_way = chance_grid_of(context)
    fractions = (np.arange(context.weights.samples_per_step) + 0.5) / context.weights.samples_per_step

    def weighed(flat: FlatMap, by: Adjoint) -> float:
        if not weight:
            return 0.0
        return kernels.endangered(
            flat.position, flat.rotation, fractions, danger, by_way, weight, by.position, by.rotation
        )

    return weighed


RISK = CostTerm("risk", risk, None, risk_kernel)
