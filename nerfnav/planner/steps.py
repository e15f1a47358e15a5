"""What a planner yields: a frozen record of every iteration, the last of which carries the outcome."""

from dataclasses import dataclass
from enum import Enum

from nerfnav.planner.trajectory import Trajectory
from nerfnav.robots.state import Motion


class PlanOutcome(Enum):
    """How planning ended; the value is advice for the user."""

    CONVERGED = "the cost has settled"
    ITERATION_LIMIT = "the cost was still falling: allow more iterations"
    NO_PATH = "no free way leads from start to goal: move one of them"
    DIVERGED = "the cost became infinite or NaN: lower the learning rate"


@dataclass(frozen=True)
class PlanCost:
    """The terms of J (paper Eq. 2), summed over the trajectory, weights included."""

    collision: float
    """Sum of density times distance travelled, over body points and steps [1]."""
    control: float
    """Sum of u' Gamma u."""
    limits: float
    """Penalties that keep the motion well defined, such as the thrust floor."""

    @property
    def total(self) -> float:
        """J."""
        return self.collision + self.control + self.limits


@dataclass(frozen=True)
class PlanStep:
    """One iteration of a planner."""

    iteration: int
    """Counted from 0."""
    trajectory: Trajectory
    """The trajectory after this iteration."""
    motion: Motion
    """What the robot would do."""
    cost: PlanCost
    """J of this trajectory."""
    outcome: PlanOutcome | None = None
    """None while planning goes on; set on the last step."""
