"""Minimum-snap planner: a baseline of the paper, see baselines/minsnap.py."""

import dataclasses
from dataclasses import dataclass

from nerfnav.planner.baselines.minsnap import MinSnapConfig, plan_minimum_snap
from nerfnav.planner.baselines.waypoint_following import replan_rest
from nerfnav.planner.planners.planner import FieldPlanner, PlannerEntry
from nerfnav.planner.steps import PlanSteps
from nerfnav.planner.trajectory import Route
from nerfnav.robots import Motion


@dataclass(frozen=True)
class MinSnapPlanner(FieldPlanner):
    """Plan by A* and minimum snap; replan by returning to the rest of that curve from the robot's state."""

    first: MinSnapConfig = dataclasses.field(default_factory=MinSnapConfig)
    """Settings of the first plan."""
    again: MinSnapConfig = dataclasses.field(default_factory=MinSnapConfig)
    """Weights of the cost of a plan that is redone."""

    def plan(self, route: Route) -> PlanSteps:
        """Plan from scratch, see Planner; one linear system has no iterations to yield."""
        yield from ()
        return plan_minimum_snap(self.problem(route), self.first, self.occupancy)

    def replan(self, last: Motion, route: Route, executed: int) -> PlanSteps:
        """Plan the rest again, see Planner."""
        yield from ()
        return replan_rest(self.rest(last, route), last, executed, self.again.weights)


MINSNAP = PlannerEntry("minsnap", MinSnapPlanner, MinSnapConfig, color=(250, 204, 21))
