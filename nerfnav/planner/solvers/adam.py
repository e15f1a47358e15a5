"""Adam: minimise Eq. 2 over the flat waypoints with autodiff; the paper's planner.

    W* = argmin_W J(W),   J as in risk/costs.py,   W the robot's free numbers between fixed ends
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import torch

from nerfnav.planner.objective.problem import InitialGuess, PlanProblem, first_guess
from nerfnav.planner.objective.safety import downgrade_outcome
from nerfnav.planner.risk.costs import CostWeights
from nerfnav.planner.space.ends import check_finite
from nerfnav.planner.space.occupancy import OccupancyConfig, OccupancyMap
from nerfnav.planner.steps import PlanOutcome, PlanStep
from nerfnav.planner.terms.term import Evaluated
from nerfnav.planner.trajectory import Trajectory
from nerfnav.robots import Motion

_SETTLING_ITERATIONS = 25
"""Fewest iterations over which a cost can be seen to have settled."""


@dataclass(frozen=True)
class PlanConfig:
    """How Eq. 2 is minimised."""

    iterations: int = 2500
    """Steps of Adam: 2,500 in the paper, 250 for replanning."""
    learning_rate: float = 1e-3
    """Of Adam, for metres, newtons and radians alike."""
    initial: InitialGuess = InitialGuess.ASTAR
    """A* as in the paper; a straight line through a hollow stone stays in there."""
    weights: CostWeights = field(default_factory=CostWeights)
    """What the terms of J weigh."""
    occupancy: OccupancyConfig = field(default_factory=OccupancyConfig)
    """How the field becomes a map for A*."""
    settled_change: float = 0.01
    """The cost counts as settled when the last tenth of the iterations (25 at least) improved the best J by less than
    this share of its control part, which is nearly all that is left of J on a free way."""

    @classmethod
    def paper(cls) -> "PlanConfig":
        """2,500 iterations from A*."""
        return cls()

    @classmethod
    def paper_replan(cls) -> "PlanConfig":
        """250 iterations from the rest of the last plan."""
        return cls(iterations=250)


def plan(
    problem: PlanProblem, config: PlanConfig | None = None, occupancy: OccupancyMap | None = None
) -> Iterator[PlanStep]:
    """Plan from scratch; yields every iteration, the last with the best trajectory of all and the outcome.

    `occupancy` saves making the map again where the caller has it. Raises InvalidInputError, OutsideBoxError or
    OccupiedError for ends that cannot be planned between, at the first step.
    """
    config = PlanConfig.paper() if config is None else config
    guess = first_guess(problem, config.initial, config.occupancy if occupancy is None else occupancy)
    if not guess.leads:
        yield _step(problem, guess.trajectories[0], config, 0, PlanOutcome.NO_PATH)
        return
    yield from descend(problem, guess.trajectories[0], config)


def replan(problem: PlanProblem, trajectory: Trajectory, config: PlanConfig | None = None) -> Iterator[PlanStep]:
    """Improve a trajectory that is already near a good one, such as `shift_warm_start` gives; yields as `plan` does.

    Start and goal are those of `trajectory`, and are not checked against the field: a robot must get away from
    wherever it finds itself.
    """
    check_finite("start", trajectory.start)
    yield from descend(problem, trajectory, PlanConfig.paper_replan() if config is None else config)


def descend(problem: PlanProblem, trajectory: Trajectory, config: PlanConfig) -> Iterator[PlanStep]:
    """Minimise J over the free numbers of `trajectory` with Adam."""
    free = trajectory.free.detach().clone().requires_grad_()
    adam = torch.optim.Adam([free], lr=config.learning_rate)
    best: PlanStep | None = None
    settling = float("inf")  # the best J when the last iterations began
    last_ones = max(_SETTLING_ITERATIONS, config.iterations // 10)
    for iteration in range(config.iterations):
        motion = trajectory.with_free(free).motion(problem.robot)
        terms = problem.cost(motion, config.weights)
        now = _record(iteration, trajectory.with_free(free.detach().clone()), motion, terms)
        if not torch.isfinite(terms.total):
            yield replace(best or now, iteration=iteration, outcome=PlanOutcome.DIVERGED)
            return
        best = now if best is None or now.cost.total < best.cost.total else best
        if iteration < max(1, config.iterations - last_ones):
            settling = best.cost.total
        if iteration == config.iterations - 1:
            settled = settling - best.cost.total <= config.settled_change * best.cost.control
            outcome = PlanOutcome.CONVERGED if settled else PlanOutcome.ITERATION_LIMIT
            yield replace(best, iteration=iteration, outcome=downgrade_outcome(problem, best.motion, outcome))
            return
        yield now
        adam.zero_grad()
        terms.total.backward()
        adam.step()


def _step(
    problem: PlanProblem, trajectory: Trajectory, config: PlanConfig, iteration: int, outcome: PlanOutcome
) -> PlanStep:
    with torch.no_grad():
        motion = trajectory.motion(problem.robot)
        terms = problem.cost(motion, config.weights)
    return replace(_record(iteration, trajectory, motion, terms), outcome=outcome)


def _record(iteration: int, trajectory: Trajectory, motion: Motion, terms: Evaluated) -> PlanStep:
    return PlanStep(iteration, trajectory, motion.detach(), terms.numbers())
