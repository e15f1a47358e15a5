"""The fast planner: the paper's objective, Eq. 2, minimised by quasi-Newton on compiled kernels.

Same terms, same ends, same dynamics as optimize.py; some hundred iterations of a fraction of a millisecond in place
of 2,500 of several. Adam with any learning rate falls short: J at the start is nearly all control effort, whose
curvature spans many orders of magnitude, so what matters is the preconditioner (quasi_newton.py).
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import torch

from nerfnav.planner.costs import CostWeights
from nerfnav.planner.ends import check_finite
from nerfnav.planner.objective import Evaluation, Objective
from nerfnav.planner.occupancy import OccupancyConfig, OccupancyMap
from nerfnav.planner.problem import InitialGuess, PlanProblem, first_guess
from nerfnav.planner.quasi_newton import NewtonConfig, minimise
from nerfnav.planner.steps import PlanOutcome, PlanStep
from nerfnav.planner.trajectory import Trajectory
from nerfnav.robots.flat_map import FlatMap
from nerfnav.robots.maps import flat_map


@dataclass(frozen=True)
class FastPlanConfig:
    """How Eq. 2 is minimised, fast."""

    newton: NewtonConfig = field(default_factory=NewtonConfig)
    """The search."""
    initial: InitialGuess = InitialGuess.ASTAR
    """Where it starts."""
    weights: CostWeights = field(default_factory=CostWeights)
    """What the terms of J weigh: the same as the paper's planner by default."""
    occupancy: OccupancyConfig = field(default_factory=OccupancyConfig)
    """How the field becomes a map for A*."""

    @property
    def iterations(self) -> int:
        """Most iterations that planning may take."""
        return self.newton.iterations


def plan_fast(
    problem: PlanProblem, config: FastPlanConfig | None = None, occupancy: OccupancyMap | None = None
) -> Iterator[PlanStep]:
    """Plan from scratch; yields every iteration, J falling from one to the next, the last with the outcome.

    `occupancy` saves making the map again where the caller has it. Raises InvalidInputError, OutsideBoxError or
    OccupiedError for ends that cannot be planned between, at the first step.
    """
    config = FastPlanConfig() if config is None else config
    guess = first_guess(problem, config.initial, config.occupancy if occupancy is None else occupancy)
    for step in replan_fast(problem, guess.trajectory, config):
        if not guess.leads:
            yield replace(step, outcome=PlanOutcome.NO_PATH)
            return
        yield step


def replan_fast(
    problem: PlanProblem, trajectory: Trajectory, config: FastPlanConfig | None = None
) -> Iterator[PlanStep]:
    """Improve a trajectory that is already near a good one, such as `hot_start` gives; yields as `plan_fast` does."""
    config = FastPlanConfig() if config is None else config
    check_finite("start", trajectory.start)
    robot = problem.robot
    flat = flat_map(robot, trajectory.start, trajectory.goal, trajectory.steps, trajectory.dt)
    objective = Objective(problem.field, robot, flat, trajectory.steps, config.weights)
    free = trajectory.free.double().numpy()
    scales = robot.free_scales(trajectory.free).double().numpy()
    previous: PlanStep | None = None
    outcome = PlanOutcome.ITERATION_LIMIT
    for iteration, (reached, settled) in enumerate(minimise(objective, free, scales, config.newton)):
        if previous is not None:
            yield previous
        previous = _record(iteration, trajectory, flat, reached)
        outcome = PlanOutcome.CONVERGED if settled else PlanOutcome.ITERATION_LIMIT
    assert previous is not None, "a search yields at least its start"
    yield replace(previous, outcome=outcome if math.isfinite(previous.cost.total) else PlanOutcome.DIVERGED)


def _record(iteration: int, trajectory: Trajectory, flat: FlatMap, reached: Evaluation) -> PlanStep:
    flat.forward(reached.free)  # the search may have looked elsewhere since
    free = torch.from_numpy(reached.free).to(trajectory.free)
    return PlanStep(iteration, trajectory.with_free(free), flat.motion(), reached.cost)
