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
from nerfnav.planner.moving.movers import Movers
from nerfnav.planner.risk.tracking_error import RiskContext, tracking_deviations
from nerfnav.planner.terms.term import Adjoint, CostTerm, Kernel, TermContext
from nerfnav.robots import FlatMap, Motion, Robot

MoverArguments = tuple[np.ndarray, tuple[np.ndarray, np.ndarray, np.ndarray], float, float]
"""First arguments of the kernel `nearness` after the positions."""

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

    def value(context: TermContext, motion: Motion) -> Float[Tensor, "*batch"]:
        position = motion.states.position
        fractions, (centers, axes, halves), deviation, depth = arguments(context, position.shape[-2] - 1, motion.dt)
        share = torch.from_numpy(fractions).to(position)[:, None]
        along = position[..., :-1, None, :] + share * position.diff(dim=-2)[..., None, :]
        off = along[..., None, :] - torch.from_numpy(centers).to(position)
        gap = torch.einsum("mij,...mj->...mi", torch.from_numpy(axes).to(position), off).abs()
        gap = gap - torch.from_numpy(halves).to(position)
        outside = (gap.clamp_min(0).square().sum(-1) + 1e-24).sqrt()
        distance = torch.where(gap.amax(-1) > 0, outside, gap.amax(-1))
        cost = torch.special.ndtr(-distance / deviation) + (distance.clamp_max(0) / depth).square()
        return torch.where(distance > 6 * deviation, torch.zeros_like(cost), cost).sum((-3, -2, -1)) / len(fractions)

    def kernel(context: TermContext, weight: float) -> Kernel:
        def weighed(flat: FlatMap, by: Adjoint) -> float:
            known = arguments(context, len(flat.position) - 1, flat.dt)
            return kernels.nearness(flat.position, *known, weight, by.position)

        return weighed

    known = dict[tuple[int, float, Robot, RiskContext], MoverArguments]()

    def arguments(context: TermContext, steps: int, dt: float) -> MoverArguments:
        at = steps, dt, context.robot, context.risk_context
        if at not in known:
            known[at] = mover_arguments(movers, time, context, steps, dt)
        return known[at]

    return CostTerm("movers", value, _PRICE, kernel, fused=arguments)


def mover_arguments(movers: Movers | None, time: float, context: TermContext, steps: int, dt: float) -> MoverArguments:
    """Return what the kernel asks for: fractions of a step, boxes at them, the deviation [m] and the depth [m]."""
    fractions = (np.arange(_PARTS) + 0.5) / _PARTS
    if movers is None:
        return fractions, (np.zeros((steps, _PARTS, 0, 3)), np.zeros((0, 3, 3)), np.zeros((0, 3))), 1.0, _DEPTH
    times = time + dt * (np.arange(steps)[:, None] + fractions)
    boxes = movers.boxes(times.ravel(), context.robot.body)
    centers = boxes.centers.reshape(steps, _PARTS, -1, 3)
    return fractions, (centers, boxes.axes, boxes.halves), deviation_of(context), _DEPTH
