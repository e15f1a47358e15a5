"""Safety of a plan: the bound of Eq. 1 step by step, the clearance, and the outcome that they allow.

    bound(t) = sum_b rho(x_b) s(b)      P(collision) <= sum_t bound(t)      (Boole's inequality, twice)

All of it rests on the field's densities, and a bound is no guarantee. In a field with evidence
(field/core/occupancy.py) it is founded on proofs, if `field` is the one to plan in: where space is proven free the
density is 0, however much light fog was learned there, and what is unproven counts as solid. So does what is beyond the
field's box (space/border.py).
"""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.field import Field
from nerfnav.planner.moving.movers import Movers
from nerfnav.planner.objective.clearance import SafetyConfig, measure_clearance
from nerfnav.planner.objective.problem import PlanProblem
from nerfnav.planner.risk.costs import PathDensity
from nerfnav.planner.space.scales import scales_of
from nerfnav.planner.steps import FLYABLE, PlanCost, PlanOutcome
from nerfnav.robots import Body, Motion, limit_uses

_CERTAIN = 1.0
"""Expected hits along the path of one body point that count as certain."""
NEAR_CERTAIN = 0.5
"""Bound on the probability of a collision from which a plan does not count as good: as likely as not."""


@dataclass(frozen=True)
class Safety:
    """Safety of a plan by the field's densities."""

    per_step: Float[Tensor, " n"]
    """Upper bound of the probability of a collision in each step."""
    bound: float
    """Their sum, an upper bound of the probability that the plan collides, at most 1. It counts every body point as
    if it flew alone, so that light fog on many points already brings it to 1."""
    min_clearance_m: float | None
    """Smallest distance of the body from dense space or from the border of the field's box [m], 0 inside or beyond
    them; None where none is within reach."""
    worst_step: int
    """The step with the largest bound."""


@torch.no_grad()
def assess_safety(
    field: Field, motion: Motion, body: Body, config: SafetyConfig | None = None, movers: Movers | None = None
) -> Safety:
    """Assess one motion in the field, and among movers from time 0 on: a step in which one is touched is a collision
    for certain, and the distance from them counts as clearance."""
    config = SafetyConfig() if config is None else config
    steps = PathDensity.of(field, motion, body).bound_per_step
    clearance = measure_clearance(field, motion, body, config)
    if movers is not None:
        gaps, steps = count_movers(movers, motion, body, steps)
        nearest = gaps.min().item()
        if nearest < (config.lengths(field, body)[1] if clearance is None else clearance):
            clearance = nearest
    return Safety(steps, min(1.0, steps.sum().item()), clearance, int(steps.argmax()))


def count_movers(
    movers: Movers, motion: Motion, body: Body, per_step: Float[Tensor, " n"], time: float = 0.0
) -> tuple[Float[Tensor, " n"], Float[Tensor, " n"]]:
    """Return the distance from movers in each step of a motion that begins at a time of the flight [s], 0 where one is
    touched [m], and the bounds `per_step` with these steps as collisions for certain."""
    gaps = torch.from_numpy(movers.least_gaps(motion.states, motion.dt, body, time))
    return gaps.clamp_min(0.0), torch.where(gaps <= 0, per_step.clamp_min(1.0), per_step)


def judge_search(
    problem: PlanProblem, motion: Motion, cost: PlanCost, outcome: PlanOutcome, along: PathDensity | None = None
) -> PlanOutcome:
    """Replace `outcome` by the fault of a plan that a search has ended with, if it has one; `along` saves measuring the
    density along the motion again."""
    if not np.isfinite(cost.total):
        return PlanOutcome.DIVERGED
    outcome = downgrade_outcome(problem, motion, outcome, along)
    if outcome is not PlanOutcome.IN_COLLISION and any(use.violated for use in limit_uses(problem.robot, motion)):
        return PlanOutcome.OVER_LIMITS
    return outcome


def downgrade_outcome(
    problem: PlanProblem, motion: Motion, outcome: PlanOutcome, along: PathDensity | None = None
) -> PlanOutcome:
    """Downgrade the outcome of a plan that counts as good where the field contradicts.

    A plan that is as likely as not to collide has not converged, nor is it worth more iterations.
    """
    if outcome not in FLYABLE:
        return outcome
    if problem.touches_movers(motion):
        return PlanOutcome.IN_COLLISION
    along = along or PathDensity.of(problem.field, motion, problem.robot.body)
    # the bound is a sum over body points: where it is small, none of them is hit for certain
    if along.bound_per_step.sum() < NEAR_CERTAIN:
        return outcome
    return PlanOutcome.IN_COLLISION if meets_density(problem, along) else PlanOutcome.LIKELY_COLLISION


def meets_density(problem: PlanProblem, along: PathDensity) -> bool:
    """Return True if the body comes into something dense or beyond the border, and one of its points is expected to be
    hit, at the way points or between them.

    One point alone, not the sum of Eq. 1: specks and light fog that all of them pass through bring that above 1 too.
    """
    dense = along.density.max() > scales_of(problem.field, problem.robot.body).threshold
    return bool(dense and along.hits.sum(0).max() >= _CERTAIN)
