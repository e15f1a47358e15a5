"""Waypoint following without an optimisation: the plan, or the rest of one, that a baseline ends with."""

from collections.abc import Iterator

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.planner.objective.problem import PlanProblem
from nerfnav.planner.objective.safety import downgrade_outcome
from nerfnav.planner.risk.costs import CostWeights
from nerfnav.planner.solvers.warm_start import shift_warm_start
from nerfnav.planner.steps import PlanOutcome, PlanStep
from nerfnav.planner.trajectory import Trajectory
from nerfnav.robots import Motion


def plan_along(
    problem: PlanProblem, waypoints: Float[Tensor, "times 4"], weights: CostWeights, outcome: PlanOutcome
) -> PlanStep:
    """The plan that follows waypoints (x, y, z [m], yaw [rad]) as nearly as ends and dynamics allow, with its J."""
    free = problem.robot.encode(waypoints, problem.start, problem.goal, problem.dt)
    trajectory = Trajectory(free, problem.route)
    return step_of(problem, trajectory, weights, outcome)


def step_of(problem: PlanProblem, trajectory: Trajectory, weights: CostWeights, outcome: PlanOutcome) -> PlanStep:
    """A trajectory as it is, with its J; `outcome`, if that is good, only where the field agrees."""
    with torch.no_grad():
        motion = trajectory.motion(problem.robot)
        cost = problem.cost(motion, weights).numbers()
    return PlanStep(0, trajectory, motion, cost, downgrade_outcome(problem, motion, outcome))


def replan_rest(problem: PlanProblem, last: Motion, executed: int, weights: CostWeights) -> Iterator[PlanStep]:
    """The rest of a plan, drawn back to from where the robot is; neither baseline has more to say in flight.

    A new minimum-snap curve at each step would be worse: whatever noise makes of the velocity swings it out.
    """
    start, goal, robot = problem.start, problem.goal, problem.robot
    trajectory = shift_warm_start(last, start, goal, robot, executed=executed, steps=problem.steps)
    yield step_of(problem, trajectory, weights, PlanOutcome.CONVERGED)
