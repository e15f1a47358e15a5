"""Chance constraint: keep the probability of a collision below a given limit.

    minimise J  subject to  P(a flight by the plan touches something) <= P_max

with the probability of sampled flights in noise (risk/probability.py) where J counts risk, else with the bound of
Eq. 1, sum_t sum_b rho(x_b) s(b). Rounds of heavier weights on collision and risk find it (a penalty method: Nocedal and
Wright, "Numerical Optimization", 2006, chapter 17). The body has no room around it meanwhile: the bound is on the body
as it is, and a larger one, kept clear of light fog outside the bound, meets more fog with the points that count.
"""

from dataclasses import replace

import torch

from nerfnav.core.steps import run_steps
from nerfnav.planner.objective.problem import PlanProblem
from nerfnav.planner.risk.costs import CostWeights, collision_probability_bound
from nerfnav.planner.risk.probability import RESOLUTION, collision_probability
from nerfnav.planner.solvers.fast import FastPlanConfig, improve, plan_fast
from nerfnav.planner.space.occupancy import OccupancyMap
from nerfnav.planner.steps import FLYABLE, PlanOutcome, PlanResult, PlanStep, PlanSteps

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
    tolerance: float = 0.0,
) -> PlanSteps:
    """Make a plan safer, whichever planner made it; yield the safest plan so far after each round.

    Costs keep the weights of `config`. A flight ends within `tolerance` [m] of the goal. The outcome is TOO_RISKY where
    the probability stays above `most`: `estimate_risk` says by how much.
    """
    best, risk = planned, estimate_risk(problem, planned, config.weights, tolerance)
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
        if found.outcome in _TO_REFINE and (now := estimate_risk(problem, found, config.weights, tolerance)) < risk:
            with torch.no_grad():
                cost = problem.cost(found.motion, config.weights).numbers()
            best, risk = replace(found, iteration=planned.iteration + turn, cost=cost), now
        yield replace(best.as_step(), iteration=planned.iteration + turn)
    missed = best.outcome in _TO_REFINE and risk > most
    return replace(best, outcome=PlanOutcome.TOO_RISKY if missed else best.outcome)


@torch.no_grad()
def estimate_risk(problem: PlanProblem, step: PlanStep, weights: CostWeights, tolerance: float = 0.0) -> float:
    """Estimate the probability of a collision: of a flight in noise, at least RESOLUTION, where the weights count risk;
    else the bound of Eq. 1."""
    if weights.risk == 0:
        return collision_probability_bound(problem.field, step.motion, problem.robot.body)
    probability = collision_probability(
        problem.field, problem.robot, step.motion, problem.noise, tolerance, movers=problem.movers, time=problem.time
    )
    return max(probability, RESOLUTION)
