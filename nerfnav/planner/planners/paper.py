"""Paper's planner: A* and Adam, then Adam again from the rest of the waypoints."""

import dataclasses
from dataclasses import dataclass, replace

from nerfnav.planner.planners.planner import FieldPlanner, PlannerEntry, with_room
from nerfnav.planner.solvers.adam import PlanConfig, plan, replan
from nerfnav.planner.solvers.warm_start import shift_warm_start
from nerfnav.planner.steps import PlanSteps
from nerfnav.planner.trajectory import Route
from nerfnav.robots import Motion


@dataclass(frozen=True)
class PaperPlanner(FieldPlanner):
    """Plan by A* and Adam; replan by Adam from the rest of the waypoints."""

    first: PlanConfig = dataclasses.field(default_factory=PlanConfig.paper)
    """Settings of the first plan."""
    again: PlanConfig = dataclasses.field(default_factory=PlanConfig.paper_replan)
    """Settings with which the plan is redone at each time step."""

    def plan(self, route: Route) -> PlanSteps:
        """Plan from scratch, see Planner."""
        return plan(self.problem(route), self.first, self.occupancy)

    def replan(self, last: Motion, route: Route, executed: int) -> PlanSteps:
        """Plan the rest again, see Planner."""
        problem = self.rest(last, route)
        trajectory = shift_warm_start(
            last, problem.start, problem.goal, self.robot, executed=executed, steps=problem.steps
        )
        return replan(problem, trajectory, self.again)


def limit_iterations(first: PlanConfig) -> PlanConfig:
    """Return the settings for flights: with room around the body, and at most the paper's iterations of replanning."""
    return with_room(replace(first, iterations=min(first.iterations, PlanConfig.paper_replan().iterations)))


PAPER = PlannerEntry("paper", PaperPlanner, PlanConfig.paper, limit_iterations, color=(196, 130, 255))
