"""Planning steps: a frozen record of every iteration of a planner, the last of which carries the outcome."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from enum import Enum

from nerfnav.planner.trajectory import Trajectory
from nerfnav.robots import Motion


class PlanOutcome(Enum):
    """How planning ended; the value is advice for the user."""

    CONVERGED = "the cost has settled"
    ITERATION_LIMIT = "the cost was still falling: allow more iterations"
    NO_PATH = "no free way leads from start to goal: move one of them"
    TIME_LIMIT = "no way was found in time: allow more time, or move one of the ends"
    IN_COLLISION = "no way around what is dense was found: move an end, or take a smaller robot"
    OVER_LIMITS = "the robot cannot do what the plan asks of it: allow more time"
    TOO_RISKY = "the bound on the chance of a collision stays above what was asked for: accept more, or move an end"
    LIKELY_COLLISION = (
        "the bound on the chance of a collision is near 1: keep the ends away from what is dense or unproven, take a "
        "smaller robot, or show the place with more photographs"
    )
    TOUCHES_MESH = "the robot would touch the true mesh, which the field does not show well enough: train it longer"
    DIVERGED = "the cost became infinite or NaN: lower the learning rate"


FLYABLE = (PlanOutcome.CONVERGED, PlanOutcome.ITERATION_LIMIT)
"""Outcomes of plans that can be flown."""


class Restart(Enum):
    """Why a plan was not carried on but made anew from where the robot is; the value is what a user reads."""

    GOAL_MOVED = "the goal is not where the last plan ends"
    COST_ROSE = "what is left of the last plan has become much dearer"
    IN_COLLISION = "what is left of the last plan leads through something dense"
    UNUSABLE = "what is left of the last plan cannot be flown"


@dataclass(frozen=True)
class TermCost:
    """What one term of J comes to, weight included."""

    name: str
    """The term's."""
    value: float
    """Weight times value."""
    ms: float = field(compare=False)
    """Time that it takes [ms], measured: its value and gradient, the mean so far, where the fast planner evaluates it;
    its value alone, once, elsewhere."""


COST_FIELDS = {"collision": 0, "control": 1, "limits": 2, "outside": 2, "risk": 3}
"""Terms of this project, and which number of a PlanCost has them."""


@dataclass(frozen=True)
class PlanCost:
    """The terms of J (paper Eq. 2), summed over the trajectory, weights included."""

    collision: float
    """Sum of density times distance travelled, over body points and steps [1]."""
    control: float
    """Sum of u' Gamma u."""
    limits: float
    """Penalties that keep the motion well defined, such as the thrust floor, and inside the box."""
    risk: float = 0.0
    """What is expected to be lost by what disturbs the robot, see terms/risk.py; 0 in the paper."""
    added: tuple[TermCost, ...] = ()
    """What was added to these, term by term."""

    @classmethod
    def of(cls, terms: Iterable[TermCost]) -> "PlanCost":
        """The report of evaluated terms."""
        own, added = [0.0] * 4, []
        for term in terms:
            if term.name in COST_FIELDS:
                own[COST_FIELDS[term.name]] += term.value
            else:
                added.append(term)
        return cls(*own, added=tuple(added))

    @property
    def total(self) -> float:
        """J."""
        return self.collision + self.control + self.limits + self.risk + sum(term.value for term in self.added)


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
    start_index: int = 0
    """Which of several first guesses this trajectory comes from."""
    restart: Restart | None = None
    """Why the plan was made anew; None where it is a first plan or carries the last one on."""


def last_step(steps: Iterator[PlanStep]) -> PlanStep:
    """Run a planner to its end."""
    last = next(steps)
    for step in steps:
        last = step
    return last
