"""Risk term: the expected number of collisions due to noise; not in Eq. 2.

    sum_t c_t(p_t, yaw_t)        c_t of risk/collision_map.py; the mean over the path of each step

counts the steps in which noise will push the robot into something: plans keep a wider distance from solid space, pass a
strait in few steps, and leave the ground early. It is soft: where there is no wider passage, the path of least risk is
taken.

When the arrival is put off at each step (a receding horizon that has reached its shortest), a sum over steps would be
least for a robot that waits outside of a strait for ever. There the same counts by distance, sum_t c_t s_t / pace,
with s_t the length of the step: waiting neither costs nor helps. Chances up to that at the goal count as none there
(see `RiskContext.end`): the robot has to go there.

It is a cost, and no probability: what is near counts anew in each step. risk/probability.py has the probability.
"""

import math

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.geometry import so3
from nerfnav.planner.kernels import terms as kernels
from nerfnav.planner.risk.collision_map import NO_CHANCE, ChanceGrid, CollisionMap
from nerfnav.planner.terms.term import Adjoint, CostTerm, Kernel, TermContext
from nerfnav.robots import FlatMap, Motion, wrap_angle


def risk(context: TermContext, motion: Motion) -> Float[Tensor, "*batch"]:
    """Sum the expected collisions [1]."""
    if context.weights.risk == 0:
        return motion.actions.new_zeros(motion.actions.shape[:-2])
    position, parts, pace = motion.states.position, context.weights.samples_per_step, context.risk_context.pace
    fractions = ((torch.arange(parts) + 0.5) / parts).to(position)
    chances = CollisionMap.of(context.field, context.robot, context.risk_context)
    turns, moved = chances.chances.shape[1] > 1, position.diff(dim=-2)
    heading = so3.yaw_of(motion.states.rotation) if turns else torch.zeros_like(position[..., 0])
    along = position[..., :-1, None, :] + fractions[:, None] * moved[..., None, :]
    turned = heading[..., :-1, None] + fractions * wrap_angle(heading.diff(dim=-1))[..., None]
    first = len(chances.chances) - 1  # steps of their own chances
    steps = [*along[..., :first, :, :].unbind(-3), along[..., first:, :, :]]
    headings = [*turned[..., :first, :].unbind(-2), turned[..., first:, :]]
    grid = chances.grid(context.risk_context)
    found = [_chance(grid, step, *at) for step, at in enumerate(zip(steps, headings, strict=True))]
    chance = torch.cat([part.reshape(*along.shape[:-3], -1, parts) for part in found], -2).mean(-1)
    if pace is not None:
        chance = chance * (moved.square().sum(-1) + kernels.STANDSTILL).sqrt() / pace
    return chance.sum(-1)


def _chance(
    grid: ChanceGrid, step: int, points: Float[Tensor, "*batch 3"], headings: Float[Tensor, "*batch"]
) -> Float[Tensor, "*batch"]:
    """Interpolate c_t at points of the world [m] with headings [rad]."""
    layers, lower, per_meter = (torch.from_numpy(part).to(points) for part in grid[:3])
    layer = layers[min(step, len(layers) - 1)]
    count, last = len(layer), torch.tensor(layer.shape[1:]).to(points) - 1
    at = (points - lower) * per_meter
    flat = (2 * at / last - 1).reshape(1, -1, 1, 1, 3).flip(-1)  # grid_sample counts axes from the last
    found = torch.nn.functional.grid_sample(layer[None], flat, padding_mode="border", align_corners=True)
    turn = headings.reshape(1, -1) / math.pi % 1 * count
    below = turn.detach().long().clamp_max(count - 1)
    first, second = (found.reshape(count, -1).gather(0, index % count)[0] for index in (below, below + 1))
    chance = (first + (turn - below)[0] * (second - first)).reshape(headings.shape)
    chance = (chance - grid[3]).clamp_min(0)
    inside = ((at >= 0) & (at <= last)).all(-1)
    return torch.where(inside, chance, torch.zeros_like(at[..., 0]))


def chance_grid_of(context: TermContext) -> tuple[ChanceGrid, float]:
    """Return the grid of chances for the kernel, and 1 / pace, or 0 where each step counts once."""
    if context.weights.risk == 0:
        return NO_CHANCE, 0.0
    pace = context.risk_context.pace
    grid = CollisionMap.of(context.field, context.robot, context.risk_context).grid(context.risk_context)
    return grid, 0.0 if pace is None else 1 / pace


def risk_kernel(context: TermContext, weight: float) -> Kernel:
    """Make the compiled twin of the term."""
    grid, by_distance = chance_grid_of(context)
    fractions = (np.arange(context.weights.samples_per_step) + 0.5) / context.weights.samples_per_step

    def weighted(flat: FlatMap, by: Adjoint) -> float:
        if not weight:
            return 0.0
        return kernels.risk(
            flat.position, flat.rotation, fractions, grid, by_distance, weight, by.position, by.rotation
        )

    return weighted


RISK = CostTerm("risk", risk, None, risk_kernel)
