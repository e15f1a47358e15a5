"""The planners that the paper compares with, in the shape that the loop asks for."""

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass

from nerfnav.navigation.planners import FieldPlanner
from nerfnav.planner.clearance import BallCheck
from nerfnav.planner.costs import CostWeights
from nerfnav.planner.follow import step_of
from nerfnav.planner.hot_start import hot_start
from nerfnav.planner.minsnap import MinSnapConfig, plan_minimum_snap
from nerfnav.planner.occupancy import OccupancyMap
from nerfnav.planner.problem import PlanProblem
from nerfnav.planner.rrt import RRTConfig, plan_rrt
from nerfnav.planner.steps import PlanOutcome, PlanStep
from nerfnav.robots.state import Motion, RigidState


@dataclass(frozen=True)
class MinSnapPlanner(FieldPlanner):
    """A* and minimum snap, then the rest of that curve, as seen from where the robot is."""

    first: MinSnapConfig = dataclasses.field(default_factory=MinSnapConfig)
    """How the first plan is made."""
    again: MinSnapConfig = dataclasses.field(default_factory=MinSnapConfig)
    """What the cost of a plan that is redone weighs."""
    occupancy: OccupancyMap | None = None
    """Saves making the map of the field again where the caller has it."""

    def plan(self, start: RigidState, goal: RigidState, steps: int, dt: float) -> Iterator[PlanStep]:
        """See Planner."""
        return plan_minimum_snap(self.problem(start, goal, steps, dt), self.first, self.occupancy)

    def replan(
        self, last: Motion, start: RigidState, goal: RigidState, steps: int, executed: int
    ) -> Iterator[PlanStep]:
        """See Planner."""
        return _carried_on(self.rest(last, start, goal, steps), last, executed, self.again.weights)


@dataclass(frozen=True)
class RRTPlanner(FieldPlanner):
    """RRT and a controller that follows its path, then the rest of what was flown, as seen from where the robot is."""

    first: RRTConfig = dataclasses.field(default_factory=RRTConfig)
    """How the first plan is made."""
    again: RRTConfig = dataclasses.field(default_factory=RRTConfig)
    """What the cost of a plan that is redone weighs; no tree is grown again."""
    occupancy: OccupancyMap | None = None
    """Saves making the map of the field again where the caller has it."""
    check: BallCheck | None = None
    """Saves making the mesh of the field again where the caller has it."""

    def plan(self, start: RigidState, goal: RigidState, steps: int, dt: float) -> Iterator[PlanStep]:
        """See Planner."""
        return plan_rrt(self.problem(start, goal, steps, dt), self.first, self.occupancy, self.check)

    def replan(
        self, last: Motion, start: RigidState, goal: RigidState, steps: int, executed: int
    ) -> Iterator[PlanStep]:
        """See Planner."""
        return _carried_on(self.rest(last, start, goal, steps), last, executed, self.again.weights)


def _carried_on(problem: PlanProblem, last: Motion, executed: int, weights: CostWeights) -> Iterator[PlanStep]:
    """The rest of a plan, drawn back to from where the robot is; neither baseline has more to say in flight.

    A new minimum-snap curve at each step would be worse: whatever noise makes of the velocity swings it out.
    """
    start, goal, robot = problem.start, problem.goal, problem.robot
    trajectory = hot_start(last, start, goal, robot, executed=executed, steps=problem.steps)
    yield step_of(problem, trajectory, weights, PlanOutcome.CONVERGED)
