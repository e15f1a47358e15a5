"""RRT planner: a baseline of the paper, see baselines/rrt.py."""

import dataclasses
from dataclasses import dataclass

from nerfnav.planner.baselines.rrt import BallCheck, RRTConfig, plan_rrt
from nerfnav.planner.baselines.waypoint_following import replan_rest
from nerfnav.planner.planners.planner import FieldPlanner, PlannerEntry
from nerfnav.planner.steps import PlanSteps
from nerfnav.planner.trajectory import Route
from nerfnav.robots import Motion


@dataclass(frozen=True)
class RRTPlanner(FieldPlanner):
    """Plan by RRT and a controller that follows its path; replan by returning to the rest of the flown motion."""

    first: RRTConfig = dataclasses.field(default_factory=RRTConfig)
    """Settings of the first plan."""
    again: RRTConfig = dataclasses.field(default_factory=RRTConfig)
    """Weights of the cost of a plan that is redone; no tree is grown again."""
    check: BallCheck | None = None
    """Saves making the mesh of the field again where the caller has it."""

    def plan(self, route: Route) -> PlanSteps:
        """Plan from scratch, see Planner; a tree has no iterations to yield."""
        yield from ()
        return plan_rrt(self.problem(route), self.first, self.occupancy, self.check)

    def replan(self, last: Motion, route: Route, executed: int) -> PlanSteps:
        """Plan the rest again, see Planner."""
        yield from ()
        return replan_rest(self.rest(last, route), last, executed, self.again.weights)


RRT = PlannerEntry("rrt", RRTPlanner, RRTConfig, color=(45, 212, 191))
