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
class PaperPlanner:
    """A* and Adam, then Adam again from the rest of the waypoints."""

    field: Field
    """Where."""
    robot: Robot
    """Who."""
    first: PlanConfig = dataclasses.field(default_factory=PlanConfig.paper)
    """How the first plan is made."""
    again: PlanConfig = dataclasses.field(default_factory=PlanConfig.paper_replan)
    """How the plan is redone at each time step."""
    occupancy: OccupancyMap | None = None
    """Saves making the map of the field again where the caller has it."""
    extra_terms: tuple[Callable[[Motion], Tensor], ...] = ()
    """What is added to J, see PlanProblem."""

    def plan(self, start: RigidState, goal: RigidState, steps: int, dt: float) -> Iterator[PlanStep]:
        """See Planner."""
        problem = PlanProblem(self.field, self.robot, start, goal, steps, dt, self.extra_terms)
        return plan(problem, self.first, self.occupancy)

    def replan(
        self, last: Motion, start: RigidState, goal: RigidState, steps: int, executed: int
    ) -> Iterator[PlanStep]:
        """See Planner."""
        start = self.robot.settled(start, last.states[0])
        trajectory = hot_start(last, start, goal, self.robot, executed=executed, steps=steps)
        problem = PlanProblem(self.field, self.robot, start, goal, steps, last.dt, self.extra_terms)
        return replan(problem, trajectory, self.again)


@dataclass(frozen=True)
class FastPlanner:
    """Several ways around and quasi-Newton on compiled kernels, then the rest of the plan as long as it leads."""

    field: Field
    """Where."""
    robot: Robot
    """Who."""
    first: FastPlanConfig = dataclasses.field(default_factory=FastPlanConfig)
    """How the first plan is made."""
    again: FastPlanConfig = dataclasses.field(default_factory=FastPlanConfig)
    """How the plan is redone at each time step."""
    occupancy: OccupancyMap | None = None
    """Saves making the map of the field again where the caller has it."""
    extra_terms: tuple[Callable[[Motion], Tensor], ...] = ()
    """What is added to J, see PlanProblem."""

    def plan(self, start: RigidState, goal: RigidState, steps: int, dt: float) -> Iterator[PlanStep]:
        """See Planner."""
        problem = PlanProblem(self.field, self.robot, start, goal, steps, dt, self.extra_terms)
        return plan_fast(problem, self.first, self.occupancy)

    def replan(
        self, last: Motion, start: RigidState, goal: RigidState, steps: int, executed: int
    ) -> Iterator[PlanStep]:
        """See Planner."""
        start = self.robot.settled(start, last.states[0])
        problem = PlanProblem(self.field, self.robot, start, goal, steps, last.dt, self.extra_terms)
        return carry_on(problem, last, executed, self.again, self.occupancy)
