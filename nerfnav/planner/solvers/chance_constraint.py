"""Chance constraint: keep the bound on the probability of a collision below a given limit.

    minimise J  subject to  sum_t sum_b rho(x_b) s(b) <= P

with the expected collisions due to noise (terms/risk.py) added to the sum where J counts them, by rounds of heavier
weights on collision (a penalty method: Nocedal and Wright, "Numerical Optimization", 2006, chapter 17). The body has
no room around it meanwhile: the bound is on the body as it is, and a larger one, kept clear of light fog outside the
bound, meets more fog with the points that count.
"""

from dataclasses import replace

import torch

from nerfnav.core.steps import run_steps
from nerfnav.planner.objective.problem import PlanProblem
from nerfnav.planner.risk.costs import CostWeights, collision_probability_bound
from nerfnav.planner.solvers.fast import FastPlanConfig, improve, plan_fast
from nerfnav.planner.space.occupancy import OccupancyMap
from nerfnav.planner.steps import FLYABLE, PlanOutcome, PlanResult, PlanStep, PlanSteps
from nerfnav.planner.terms.risk import RISK

_TO_REFINE = (*FLYABLE, PlanOutcome.LIKELY_COLLISION)
"""Outcomes of plans that can be made safer."""
_IMPROVING, _ANEW = (10.0, 100.0, 1000.0), (100.0,)
"""Factors on the weight of collision in the rounds that improve the given plan, and in those that then search another
path."""


def enforce_chance_constraint(
    problem: PlanProblem,
    planned: PlanResult,
    config: FastPlanConfig,
    most: float,
    occupancy: OccupancyMap | None = None,
) -> PlanSteps:
    """Make a plan safer, whichever planner made it; yield the safest plan so far after each round.

    Costs keep the weights of `config`. The outcome is TOO_RISKY where the bound stays above `most`: `bound_risk` says
    by how much.
    """
    best, risk = planned, bound_risk(problem, planned, config.weights)
    for turn, factor in enumerate((*_IMPROVING, *_ANEW), 1):
        if risk <= most or best.outcome not in _TO_REFINE:
            break
        heavier = {name: factor * getattr(config.weights, name) for name in ("collision", "risk")}
        careful = replace(config, weights=replace(config.weights, margin=0.0, **heavier))
        found = run_steps(
            improve(problem, (best.trajectory,), careful)
            if turn <= len(_IMPROVING)
            else plan_fast(problem, careful, occupancy)
        )
        if found.outcome in _TO_REFINE and (now := bound_risk(problem, found, config.weights)) < risk:
            with torch.no_grad():
                cost = problem.cost(found.motion, config.weights).numbers()
            best, risk = replace(found, iteration=planned.iteration + turn, cost=cost), now
        yield replace(best.as_step(), iteration=planned.iteration + turn)
    missed = best.outcome in _TO_REFINE and risk > most
    return replace(best, outcome=PlanOutcome.TOO_RISKY if missed else best.outcome)


@torch.no_grad()
def bound_risk(problem: PlanProblem, step: PlanStep, weights: CostWeights) -> float:
    """Bound the probability of a collision, at most 1: Eq. 1 and, where the weights count risk, the expected collisions
    due to noise."""
    bound = collision_probability_bound(problem.field, step.motion, problem.robot.body)
    if weights.risk == 0:
        return bound
    return min(1.0, bound + RISK.value(problem.context(weights), step.motion).item())
