"""Chance constraint: a plan whose bound on the probability of a collision stays below what was asked for.

    minimise J  subject to  sum_t sum_b rho(x_b) s(b) <= P

with the collisions to be expected of noise (terms/risk.py) added to the sum where J counts them, by rounds of heavier
weights on collision (a penalty method: Nocedal and Wright, "Numerical Optimization", 2006, chapter 17). The body has
no room around it meanwhile: the bound is on the body as it is, and a larger one, kept clear of light fog that the
bound knows nothing of, meets more fog with the points that count.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import torch

from nerfnav.planner.objective.problem import PlanProblem
from nerfnav.planner.risk.costs import CostWeights, collision_probability_bound
from nerfnav.planner.solvers.fast import FastPlanConfig, improve, plan_fast
from nerfnav.planner.space.occupancy import OccupancyMap
from nerfnav.planner.steps import FLYABLE, PlanOutcome, PlanStep, last_step
from nerfnav.planner.terms.risk import RISK

_TO_REFINE = (*FLYABLE, PlanOutcome.LIKELY_COLLISION)
"""Outcomes of plans that can be made safer."""


@dataclass(frozen=True)
class ChanceConstraintConfig:
    """How a plan is made safer."""

    improving: tuple[float, ...] = (10.0, 100.0, 1000.0)
    """By how much more collision weighs in the rounds that improve the plan there is."""
    anew: tuple[float, ...] = (100.0,)
    """The same for the rounds that look for another way then."""


def enforce_chance_constraint(
    problem: PlanProblem,
    planned: PlanStep,
    config: FastPlanConfig,
    most: float,
    occupancy: OccupancyMap | None = None,
) -> Iterator[PlanStep]:
    """Yield the safest plan so far after each round, the last with the outcome; costs keep the weights of `config`.

    `planned` is the last step of any planner. The outcome is TOO_RISKY where the bound stays above `most`:
    `bound_risk` says by how much.
    """
    chance, best = ChanceConstraintConfig(), planned
    risk, weighed = bound_risk(problem, best, config.weights), (*chance.improving, *chance.anew)
    for turn, factor in enumerate(weighed, 1):
        if risk <= most or best.outcome not in _TO_REFINE:
            break
        heavier = {name: factor * getattr(config.weights, name) for name in ("collision", "risk")}
        weights = replace(config.weights, margin=0.0, **heavier)
        careful = replace(config, weights=weights)
        improving = turn <= len(chance.improving)
        found = last_step(
            improve(problem, (best.trajectory,), careful) if improving else plan_fast(problem, careful, occupancy)
        )
        if found.outcome in _TO_REFINE and (now := bound_risk(problem, found, config.weights)) < risk:
            best, risk = _restated(problem, found, config.weights, planned.iteration + turn), now
        yield replace(best, iteration=planned.iteration + turn, outcome=None)
    missed = best.outcome in _TO_REFINE and risk > most
    yield replace(best, outcome=PlanOutcome.TOO_RISKY if missed else best.outcome)


def bound_risk(problem: PlanProblem, step: PlanStep, weights: CostWeights) -> float:
    """What is bounded, at most 1: Eq. 1 and, where the weights count risk, the collisions to be expected of noise."""
    bound = collision_probability_bound(problem.field, step.motion, problem.robot.body)
    if weights.risk == 0:
        return bound
    with torch.no_grad():
        return min(1.0, bound + RISK.value(problem.context(weights), step.motion).item())


def _restated(problem: PlanProblem, step: PlanStep, weights: CostWeights, iteration: int) -> PlanStep:
    """The same plan with its J under the weights that the user knows."""
    with torch.no_grad():
        cost = problem.cost(step.motion, weights).numbers()
    return replace(step, iteration=iteration, cost=cost)
