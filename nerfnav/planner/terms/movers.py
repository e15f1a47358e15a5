"""Movers term: the cost of coming near announced obstacles that move, at the time of each step; not in Eq. 2.

    sum_t mean_k sum_m  P(d < noise) + (min(d, 0) / DEPTH)^2,   noise ~ N(0, s^2)

with d the distance of the robot's centre from the box around mover m, enlarged by the robot (moving/movers.py), at the
times of K places of each step, and s twice the tracking error to the side. Inside it rises with the depth, so that a
search finds its way out.
"""

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.planner.kernels import movers as kernels
from nerfnav.planner.moving.movers import MoverBoxes, Movers
from nerfnav.planner.risk.tracking_error import tracking_deviations
from nerfnav.planner.terms.term import Adjoint, CostTerm, Kernel, TermContext
from nerfnav.robots import FlatMap, Motion

_PRICE = 100.0
"""Cost of a step in which a mover is touched for certain [J]: that of a collision by noise in flights."""
_DEPTH = 0.1
"""Depth in a mover at which the cost has doubled [m]."""
_PARTS = 3
"""Places of each step at which the distance is taken."""
_CARE = 2.0
"""Tracking errors to a deviation: with 1, plans pass movers at 5 cm, and noise then leaves no way out."""
_LEAST = 0.02
"""Least deviation [m]: that of a robot without noise, whose cost would have a step."""


def deviation_of(context: TermContext) -> float:
    """Return the deviation s that plans count on [m]."""
    last = tracking_deviations(context.robot, context.risk_context.dt, context.risk_context.noise)[-1]
    return max(_LEAST, _CARE * last.level)


def movers_term(movers: Movers, time: float) -> CostTerm:
    """Make the term of plans that begin at a time of the flight [s]."""
    fractions = (np.arange(_PARTS) + 0.5) / _PARTS

    def boxes_of(context: TermContext, steps: int, dt: float) -> MoverBoxes:
        times = time + dt * (np.arange(steps)[:, None] + fractions)
        return movers.boxes(times.ravel(), context.robot.body)

    def value(context: TermContext, motion: Motion) -> Float[Tensor, "*batch"]:
        position, deviation = motion.states.position, deviation_of(context)
        boxes = boxes_of(context, position.shape[-2] - 1, motion.dt)
        axes, halves = (torch.from_numpy(part).to(position) for part in (boxes.axes, boxes.halves))
        share = torch.from_numpy(fractions).to(position)[:, None]
        along = position[..., :-1, None, :] + share * position.diff(dim=-2)[..., None, :]
        off = along.flatten(-3, -2)[..., None, :] - torch.from_numpy(boxes.centers).to(position)
        gap = torch.einsum("mij,...mj->...mi", axes, off).abs() - halves
        outside = (gap.clamp_min(0).square().sum(-1) + 1e-24).sqrt()
        distance = torch.where(gap.amax(-1) > 0, outside, gap.amax(-1))
        cost = torch.special.ndtr(-distance / deviation) + (distance.clamp_max(0) / _DEPTH).square()
        return torch.where(distance > 6 * deviation, torch.zeros_like(cost), cost).sum((-2, -1)) / _PARTS

    def kernel(context: TermContext, weight: float) -> Kernel:
        deviation, known = deviation_of(context), dict[tuple[int, float], tuple[np.ndarray, ...]]()

        def weighted(flat: FlatMap, by: Adjoint) -> float:
            at = (len(flat.position) - 1, flat.dt)
            if at not in known:
                boxes = boxes_of(context, *at)
                known[at] = boxes.centers.reshape(at[0], _PARTS, -1, 3), boxes.axes, boxes.halves
            return kernels.nearness(flat.position, fractions, known[at], deviation, _DEPTH, weight, by.position)

        return weighted

    return CostTerm("movers", value, _PRICE, kernel)
