"""Steps of a flight: every iteration of planner and filter, and a record of each completed time step."""

from dataclasses import dataclass, replace
from enum import Enum

import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from nerfnav.estimator import Belief, FilterResult, FilterStep, RelocaliseResult, RelocaliseStep
from nerfnav.navigation.fallback import FallbackTrajectory
from nerfnav.navigation.supervisor import SupervisorState
from nerfnav.planner import PlanStep, estimate_timing
from nerfnav.planner.steps import Restart
from nerfnav.robots import Motion, RigidState, Robot


class EpisodeOutcome(Enum):
    """How a flight ended; the value is what a user reads."""

    REACHED = "the robot is at the goal"
    COLLIDED = "the robot touched the ground-truth mesh"
    DIVERGED = "the filter lost the robot"
    TIMEOUT = "the goal was not reached in time"
    NO_PLAN = "no plan leads to the goal"
    TOO_RISKY = "no way was found that is safe enough in the noise to come"
    STOPPED = "the flight was stopped on the way"


@dataclass(frozen=True)
class NavigationStep:
    """One time step: action, picture, belief, new plan."""

    index: int
    """Time step, 0 is the start before any action."""
    time: float
    """[s]"""
    action: Float[Tensor, " a"] | None
    """The action that led here; None at index 0."""
    truth: RigidState
    """Where the robot is."""
    belief: Belief
    """Where it believes to be."""
    image: UInt8[Tensor, "height width 3"] | None
    """What its camera saw; None in open loop, where no picture came, and at index 0 where the robot did not look."""
    update: FilterResult | None
    """Result of the filter, with its pixels; None where there was no picture."""
    plan: Motion
    """What it intends to do from here, from the belief's mean or the nearest state that the robot can be in; in open
    loop what is left of the first plan, wherever it believes to be."""
    touched: bool
    """Whether the body met the ground truth on the way here; False where there is no ground truth."""
    filter_ms: float
    """Time the filter took [ms]."""
    replan_ms: float
    """Time the planner took [ms]."""
    outcome: EpisodeOutcome | None = None
    """None while the flight goes on; set on the last step."""
    restart: Restart | None = None
    """Why the plan was made anew in this step; None where the last one was carried on."""
    recovery: SupervisorState | None = None
    """What was done where the picture disagreed with the belief, or the plan was no longer safe; else None."""
    late: bool = False
    """Whether filter and planner were still at an earlier step: the robot flew blind, by an older plan."""
    hits_expected: float | None = None
    """Collisions to be expected of noise along the first plan, at index 0, by planner/risk/tracking_error.py: mostly
    more than there will be, for what is near counts anew in each step. No bound: plans made on the way may dare more,
    and a quick step counts by the mean over its way. Of 2,000 flights between the church's tasks with the state known,
    61 touched something where 148 had been expected. None where nobody guards the flight."""
    backup: FallbackTrajectory | None = None
    """The way to come to rest that was kept ready beside the plan; None where nothing kept one."""
    apparent: Belief | None = None
    """Where the field shows the robot, without errors that come with every picture (estimator/map_error.py): what
    the estimator goes on with, and what doubts are about; None: as `belief`, which has them."""

    @property
    def followed(self) -> Belief:
        """What the estimator goes on with."""
        return self.belief if self.apparent is None else self.apparent

    @property
    def holds(self) -> bool:
        """Whether the robot comes to rest and waits, for it does not know where it is, or no way on."""
        return self.recovery is not None and self.recovery.holds


@dataclass(frozen=True)
class SupervisorMemory:
    """How long a robot has not known where it is, or no way on."""

    way: Motion
    """The last plan that was made to lead to the goal."""
    made: int = 0
    """At which time step."""
    held: int = 0
    """Time steps since, in which the robot held."""
    unsure: int = 0
    """Of these, those in which it did not know where it is."""
    lost: int = 0
    """Pictures since that disagreed."""
    adrift: int = 0
    """Pictures since that told too little to find a robot that may be anywhere near."""

    def after(self, step: NavigationStep) -> "SupervisorMemory":
        """After one more time step."""
        if not step.holds:
            return SupervisorMemory(step.plan, step.index)
        doubts = step.recovery is not SupervisorState.BACKUP
        adrift = step.recovery is SupervisorState.ADRIFT and not step.late
        disagreed = step.recovery in (SupervisorState.WIDENED, SupervisorState.SEARCHED) and not step.late
        return replace(
            self, held=self.held + 1, unsure=self.unsure + doubts, lost=self.lost + disagreed,
            adrift=self.adrift + adrift,
        )  # fmt: skip

    def steps_left(self, believed: RigidState, robot: Robot) -> int:
        """Time steps that the rest of the way takes; for a robot that has stopped, as many as from rest."""
        left, dt = len(self.way.actions) - 1, self.way.dt
        if self.held == 0:
            return left
        corners = torch.cat([believed.position[None], self.way.states.position[1:]])
        length = corners.diff(dim=0).norm(dim=-1).sum().item()
        return max(left, estimate_timing(robot, length, dt, dt).steps)


Iteration = PlanStep | FilterStep
"""What planner and filter go through within a time step."""
LoopEvent = Iteration | RelocaliseStep | RelocaliseResult | NavigationStep
"""What `navigate` yields, in the order in which it happens."""
