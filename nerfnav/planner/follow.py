"""Plans that follow waypoints as they are, without an optimisation: what the baselines end with."""

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.planner.costs import CostWeights
from nerfnav.planner.problem import PlanProblem
from nerfnav.planner.safety import honest
from nerfnav.planner.steps import PlanOutcome, PlanStep
from nerfnav.planner.trajectory import Trajectory


def step_along(
    problem: PlanProblem, waypoints: Float[Tensor, "times 4"], weights: CostWeights, outcome: PlanOutcome
) -> PlanStep:
    """The plan that follows waypoints (x, y, z [m], yaw [rad]) as nearly as ends and dynamics allow, with its J."""
    free = problem.robot.encode(waypoints, problem.start, problem.goal, problem.dt)
    trajectory = Trajectory(free, problem.start, problem.goal, problem.steps, problem.dt)
    return step_of(problem, trajectory, weights, outcome)


def step_of(problem: PlanProblem, trajectory: Trajectory, weights: CostWeights, outcome: PlanOutcome) -> PlanStep:
    """A trajectory as it is, with its J; `outcome`, if that is good, only where the field agrees."""
    with torch.no_grad():
        motion = trajectory.motion(problem.robot)
        cost = problem.terms(motion, weights).numbers()
    return PlanStep(0, trajectory, motion, cost, honest(problem, motion, outcome))
