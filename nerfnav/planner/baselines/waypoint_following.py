"""Waypoint following without optimisation: a baseline's plan, and in flight a replan that continues the last motion."""

from jaxtyping import Float
from torch import Tensor

from nerfnav.planner.objective.problem import PlanProblem
from nerfnav.planner.objective.safety import downgrade_outcome
from nerfnav.planner.risk.costs import CostWeights
from nerfnav.planner.solvers.warm_start import shift_warm_start
from nerfnav.planner.steps import PlanOutcome, PlanResult
from nerfnav.planner.trajectory import Trajectory
from nerfnav.robots import Motion


def plan_along(
    problem: PlanProblem, waypoints: Float[Tensor, "times 4"], weights: CostWeights, outcome: PlanOutcome
) -> PlanResult:
    """Follow waypoints (x, y, z [m], yaw [rad]) as nearly as ends and dynamics allow."""
    return _judge(problem, problem.trajectory_through(waypoints), weights, outcome)


def replan_rest(problem: PlanProblem, last: Motion, executed: int, weights: CostWeights) -> PlanResult:
    """Return to the rest of a plan from the robot's state; neither baseline plans anything new in flight.

    A new minimum-snap curve at each step would be worse: noise of the velocity makes it swing out.
    """
    trajectory = shift_warm_start(
        last, problem.start, problem.goal, problem.robot, executed=executed, steps=problem.steps
    )
    return _judge(problem, trajectory, weights, PlanOutcome.CONVERGED)


def _judge(problem: PlanProblem, trajectory: Trajectory, weights: CostWeights, outcome: PlanOutcome) -> PlanResult:
    """Make a trajectory the result as it is; a good `outcome` stays only where the field agrees."""
    step = problem.evaluate(trajectory, weights)
    return step.end(downgrade_outcome(problem, step.motion, outcome))
