"""What the loop asks of a planner, and the paper's planner and the fast one in that shape."""

import dataclasses
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from torch import Tensor

from nerfnav.field.field import Field
from nerfnav.planner.fast import FastPlanConfig, plan_fast
from nerfnav.planner.hot_start import hot_start
from nerfnav.planner.occupancy import OccupancyMap
from nerfnav.planner.optimize import PlanConfig, plan, replan
from nerfnav.planner.problem import PlanProblem
from nerfnav.planner.steps import PlanStep
from nerfnav.planner.warm_start import carry_on
from nerfnav.robots.robot import Robot
from nerfnav.robots.state import Motion, RigidState


@runtime_checkable
class Planner(Protocol):
    """Anything that finds a way and then keeps finding the rest of it."""

    def plan(self, start: RigidState, goal: RigidState, steps: int, dt: float) -> Iterator[PlanStep]:
        """Plan from scratch over `steps` steps of `dt` [s]; the last step has the outcome."""
        ...

    def replan(
        self, last: Motion, start: RigidState, goal: RigidState, steps: int, executed: int
    ) -> Iterator[PlanStep]:
        """Plan from `start` with the rest of `last`, of which `executed` steps are done, as hot start.

        `start` is an estimate: what the robot cannot be in, such as a cart in the air, is read as the nearest it can.
        """
        ...


@dataclass(frozen=True)
class FieldPlanner:
    """What all planners of this project have in common: one robot in one field."""

    field: Field
    """Where."""
    robot: Robot
    """Who."""
    extra_terms: tuple[Callable[[Motion], Tensor], ...] = dataclasses.field(default=(), kw_only=True)
    """What is added to J, see PlanProblem."""

    def problem(self, start: RigidState, goal: RigidState, steps: int, dt: float) -> PlanProblem:
        """What there is to plan from scratch."""
        return PlanProblem(self.field, self.robot, start, goal, steps, dt, self.extra_terms)

    def rest(self, last: Motion, start: RigidState, goal: RigidState, steps: int) -> PlanProblem:
        """What is left to plan of `last` from an estimate, or from the nearest state that the robot can be in."""
        return self.problem(self.robot.settled(start, last.states[0]), goal, steps, last.dt)


@dataclass(frozen=True)
class PaperPlanner(FieldPlanner):
    """A* and Adam, then Adam again from the rest of the waypoints."""

    first: PlanConfig = dataclasses.field(default_factory=PlanConfig.paper)
    """How the first plan is made."""
    again: PlanConfig = dataclasses.field(default_factory=PlanConfig.paper_replan)
    """How the plan is redone at each time step."""
    occupancy: OccupancyMap | None = None
    """Saves making the map of the field again where the caller has it."""

    def plan(self, start: RigidState, goal: RigidState, steps: int, dt: float) -> Iterator[PlanStep]:
        """See Planner."""
        return plan(self.problem(start, goal, steps, dt), self.first, self.occupancy)

    def replan(
        self, last: Motion, start: RigidState, goal: RigidState, steps: int, executed: int
    ) -> Iterator[PlanStep]:
        """See Planner."""
        problem = self.rest(last, start, goal, steps)
        trajectory = hot_start(last, problem.start, goal, self.robot, executed=executed, steps=steps)
        return replan(problem, trajectory, self.again)


@dataclass(frozen=True)
class FastPlanner(FieldPlanner):
    """Several ways around and quasi-Newton on compiled kernels, then the rest of the plan as long as it leads."""

    first: FastPlanConfig = dataclasses.field(default_factory=FastPlanConfig)
    """How the first plan is made."""
    again: FastPlanConfig = dataclasses.field(default_factory=FastPlanConfig)
    """How the plan is redone at each time step."""
    occupancy: OccupancyMap | None = None
    """Saves making the map of the field again where the caller has it."""

    def plan(self, start: RigidState, goal: RigidState, steps: int, dt: float) -> Iterator[PlanStep]:
        """See Planner."""
        return plan_fast(self.problem(start, goal, steps, dt), self.first, self.occupancy)

    def replan(
        self, last: Motion, start: RigidState, goal: RigidState, steps: int, executed: int
    ) -> Iterator[PlanStep]:
        """See Planner."""
        return carry_on(self.rest(last, start, goal, steps), last, executed, self.again, self.occupancy)
