"""Adam: minimise Eq. 2 over the flat waypoints with autodiff; the paper's planner.

    W* = argmin_W J(W),   J as in risk/costs.py,   W the robot's free numbers between fixed ends
"""

from dataclasses import dataclass, field, replace

import torch

from nerfnav.planner.objective.problem import InitialGuess, PlanProblem, first_guess
from nerfnav.planner.objective.safety import downgrade_outcome
from nerfnav.planner.risk.costs import CostWeights
from nerfnav.planner.space.ends import check_finite
from nerfnav.planner.space.occupancy import OccupancyConfig, OccupancyMap
from nerfnav.planner.steps import PlanOutcome, PlanStep, PlanSteps
from nerfnav.planner.trajectory import Trajectory

_SETTLING_ITERATIONS = 25
"""Fewest iterations over which a cost can be seen to have settled."""


@dataclass(frozen=True)
class PlanConfig:
    """Settings of the minimisation of Eq. 2 by Adam."""

    iterations: int = 2500
    """Steps of Adam: 2,500 in the paper, 250 for replanning."""
    learning_rate: float = 1e-3
    """Step size of Adam, for metres, newtons and radians alike."""
    initial: InitialGuess = InitialGuess.ASTAR
    """Start of the search: A* as in the paper; a straight line through a hollow stone stays in there."""
    weights: CostWeights = field(default_factory=CostWeights)
    """Weights of the terms of J."""
    occupancy: OccupancyConfig = field(default_factory=OccupancyConfig)
    """Settings of the occupancy map for A*."""
    settled_change: float = 0.01
    """The cost counts as settled when the last tenth of the iterations (25 at least) improved the best J by less than
    this share of its control part, which is nearly all that is left of J on a free path."""

    @classmethod
    def paper(cls) -> "PlanConfig":
        """Return the paper's settings of a first plan: 2,500 iterations from A*."""
        return cls()

    @classmethod
    def paper_replan(cls) -> "PlanConfig":
        """Return the paper's settings of replanning: 250 iterations from the rest of the last plan."""
        return cls(iterations=250)


def plan(problem: PlanProblem, config: PlanConfig | None = None, occupancy: OccupancyMap | None = None) -> PlanSteps:
    """Plan from scratch; return the best trajectory of all iterations.

    `occupancy` saves making the map again where the caller has it. Raises InvalidInputError, OutsideBoxError or
    OccupiedError for ends that cannot be planned between, at the first step.
    """
    config = PlanConfig.paper() if config is None else config
    guess = first_guess(problem, config.initial, config.occupancy if occupancy is None else occupancy)
    if not guess.leads:
        return problem.evaluate(guess.trajectories[0], config.weights).end(PlanOutcome.NO_PATH)
    return (yield from descend(problem, guess.trajectories[0], config))


def replan(problem: PlanProblem, trajectory: Trajectory, config: PlanConfig | None = None) -> PlanSteps:
    """Improve a trajectory that is already near a good one, such as `shift_warm_start` gives.

    Start and goal are those of `trajectory`, and are not checked against the field: a robot must get away from
    wherever it finds itself.
    """
    check_finite("start", trajectory.start)
    return (yield from descend(problem, trajectory, PlanConfig.paper_replan() if config is None else config))


def descend(problem: PlanProblem, trajectory: Trajectory, config: PlanConfig) -> PlanSteps:
    """Minimise J over the free numbers of `trajectory` with Adam."""
    free = trajectory.free.detach().clone().requires_grad_()
    adam = torch.optim.Adam([free], lr=config.learning_rate)
    best: PlanStep | None = None
    settling = float("inf")  # the best J when the last iterations began
    last_ones = max(_SETTLING_ITERATIONS, config.iterations // 10)
    iteration = 0
    while True:
        motion = trajectory.with_free(free).motion(problem.robot)
        terms = problem.cost(motion, config.weights)
        now = PlanStep(iteration, trajectory.with_free(free.detach().clone()), motion.detach(), terms.numbers())
        if not torch.isfinite(terms.total):
            return replace(best or now, iteration=iteration).end(PlanOutcome.DIVERGED)
        best = now if best is None or now.cost.total < best.cost.total else best
        if iteration < max(1, config.iterations - last_ones):
            settling = best.cost.total
        if iteration >= config.iterations - 1:
            settled = settling - best.cost.total <= config.settled_change * best.cost.control
            outcome = PlanOutcome.CONVERGED if settled else PlanOutcome.ITERATION_LIMIT
            return replace(best, iteration=iteration).end(downgrade_outcome(problem, best.motion, outcome))
        yield now
        adam.zero_grad()
        terms.total.backward()
        adam.step()
        iteration += 1
