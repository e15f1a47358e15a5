"""Minimum-snap planner: a baseline of the paper, see baselines/minsnap.py."""

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass

from nerfnav.planner.baselines.minsnap import MinSnapConfig, plan_minimum_snap
from nerfnav.planner.baselines.waypoint_following import replan_rest
from nerfnav.planner.planners.planner import FieldPlanner, PlannerEntry
from nerfnav.planner.space.occupancy import OccupancyMap
from nerfnav.planner.steps import PlanStep
from nerfnav.planner.trajectory import Route
from nerfnav.robots import Motion


@dataclass(frozen=True)
class MinSnapPlanner(FieldPlanner):
    """A* and minimum snap, then the rest of that curve, as seen from where the robot is."""

    first: MinSnapConfig = dataclasses.field(default_factory=MinSnapConfig)
    """How the first plan is made."""
    again: MinSnapConfig = dataclasses.field(default_factory=MinSnapConfig)
    """What the cost of a plan that is redone weighs."""
    occupancy: OccupancyMap | None = None
    """Saves making the map of the field again where the caller has it."""

    def plan(self, route: Route) -> Iterator[PlanStep]:
        """See Planner."""
        return plan_minimum_snap(self.problem(route), self.first, self.occupancy)

    def replan(self, last: Motion, route: Route, executed: int) -> Iterator[PlanStep]:
        """See Planner."""
        return replan_rest(self.rest(last, route), last, executed, self.again.weights)


MINSNAP = PlannerEntry("minsnap", MinSnapPlanner, MinSnapConfig, color=(250, 204, 21))
