"""Fast planner: several paths and BFGS on compiled kernels, then a warm start with the rest of the plan."""

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass

from nerfnav.planner.planners.planner import FieldPlanner, PlannerEntry, with_risk
from nerfnav.planner.solvers.fast import FastPlanConfig, plan_fast
from nerfnav.planner.solvers.warm_start import MovedEndsConfig, replan_from, replan_moved_ends
from nerfnav.planner.space.occupancy import OccupancyMap
from nerfnav.planner.steps import PlanStep
from nerfnav.planner.trajectory import Route
from nerfnav.robots import Motion


@dataclass(frozen=True)
class FastPlanner(FieldPlanner):
    """Several ways around and quasi-Newton on compiled kernels, then the rest of the plan as long as it leads."""

    first: FastPlanConfig = dataclasses.field(default_factory=FastPlanConfig)
    """How the first plan is made."""
    again: FastPlanConfig = dataclasses.field(default_factory=FastPlanConfig)
    """How the plan is redone at each time step."""
    occupancy: OccupancyMap | None = None
    """Saves making the map of the field again where the caller has it."""

    def plan(self, route: Route) -> Iterator[PlanStep]:
        """See Planner."""
        return plan_fast(self.problem(route), self.first, self.occupancy)

    def replan(self, last: Motion, route: Route, executed: int) -> Iterator[PlanStep]:
        """See Planner."""
        return replan_from(self.rest(last, route), last, executed, self.again, self.occupancy)

    def follow(self, last: Motion, route: Route) -> Iterator[PlanStep]:
        """See InteractivePlanner."""
        return replan_moved_ends(self.problem(route), last, MovedEndsConfig(self.first), self.occupancy)


FAST = PlannerEntry("fast", FastPlanner, FastPlanConfig, with_risk, real_time=True, color=(70, 84, 255))
