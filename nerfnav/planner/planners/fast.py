"""Fast planner: several paths and BFGS on compiled kernels, then a warm start with the rest of the plan."""

import dataclasses
from dataclasses import dataclass
from typing import ClassVar

from nerfnav.planner.planners.planner import FieldPlanner, PlannerEntry, with_risk
from nerfnav.planner.solvers.fast import FastPlanConfig, plan_fast
from nerfnav.planner.solvers.warm_start import replan_from, replan_moved_ends
from nerfnav.planner.steps import PlanSteps
from nerfnav.planner.trajectory import Route
from nerfnav.robots import Motion


@dataclass(frozen=True)
class FastPlanner(FieldPlanner):
    """Plan by several paths and quasi-Newton on compiled kernels; continue a plan as long as it leads to the goal."""

    first: FastPlanConfig = dataclasses.field(default_factory=FastPlanConfig)
    """Settings of the first plan."""
    again: FastPlanConfig = dataclasses.field(default_factory=FastPlanConfig)
    """Settings with which the plan is redone at each time step."""
    avoids_movers: ClassVar[bool] = True
    keeps_headings: ClassVar[bool] = True

    def plan(self, route: Route) -> PlanSteps:
        """Plan from scratch, see Planner."""
        return plan_fast(self.problem(route), self.first, self.occupancy)

    def replan(self, last: Motion, route: Route, executed: int) -> PlanSteps:
        """Plan the rest again, see Planner."""
        return replan_from(self.rest(last, route), last, executed, self.again, self.occupancy)

    def replan_moved_ends(self, last: Motion, route: Route) -> PlanSteps:
        """Plan between moved ends, see InteractivePlanner."""
        return replan_moved_ends(self.problem(route), last, self.first, self.occupancy)


FAST = PlannerEntry("fast", FastPlanner, FastPlanConfig, with_risk, real_time=True, color=(70, 84, 255))
