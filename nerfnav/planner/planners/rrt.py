"""RRT planner: a baseline of the paper, see baselines/rrt.py."""

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass

from nerfnav.planner.baselines.rrt import BallCheck, RRTConfig, plan_rrt
from nerfnav.planner.baselines.waypoint_following import replan_rest
from nerfnav.planner.planners.planner import FieldPlanner, PlannerEntry
from nerfnav.planner.space.occupancy import OccupancyMap
from nerfnav.planner.steps import PlanStep
from nerfnav.planner.trajectory import Route
from nerfnav.robots import Motion


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

    def plan(self, route: Route) -> Iterator[PlanStep]:
        """See Planner."""
        return plan_rrt(self.problem(route), self.first, self.occupancy, self.check)

    def replan(self, last: Motion, route: Route, executed: int) -> Iterator[PlanStep]:
        """See Planner."""
        return replan_rest(self.rest(last, route), last, executed, self.again.weights)


RRT = PlannerEntry("rrt", RRTPlanner, RRTConfig, color=(45, 212, 191))
