"""Planning steps: a record of each iteration of a planner, and the result that it returns."""

from collections.abc import Generator, Iterable
from dataclasses import dataclass, field, fields
from enum import Enum

from nerfnav.planner.trajectory import Trajectory
from nerfnav.robots import Motion


class PlanOutcome(Enum):
    """Outcome of planning; the value is advice for the user."""

    CONVERGED = "the cost has settled"
    ITERATION_LIMIT = "the cost was still falling: allow more iterations"
    NO_PATH = "no free way leads from start to goal: move one of them"
    TIME_LIMIT = "no way was found in time: allow more time, or move one of the ends"
    IN_COLLISION = "no way around what is dense was found: move an end, or take a smaller robot"
    OVER_LIMITS = "the robot cannot do what the plan asks of it: allow more time"
    TOO_RISKY = "the bound on the chance of a collision stays above what was asked for: accept more, or move an end"
    LIKELY_COLLISION = (
        "the bound on the chance of a collision is near 1: keep the ends away from what is dense or unproven, or take "
        "a smaller robot"
    )
    TOUCHES_MESH = "the robot would touch the true mesh, which the field does not show well enough: train it longer"
    DIVERGED = "the cost became infinite or NaN: lower the learning rate"


FLYABLE = (PlanOutcome.CONVERGED, PlanOutcome.ITERATION_LIMIT)
"""Outcomes of plans that can be flown."""


class Restart(Enum):
    """Reason why a plan was made anew from the robot's state instead of from the last plan; the value is for users."""

    GOAL_MOVED = "the goal is not where the last plan ends"
    COST_ROSE = "what is left of the last plan has become much more costly"
    IN_COLLISION = "what is left of the last plan leads through something dense"
    SOONER = "the movers are gone, and another plan arrives clearly sooner"
    UNUSABLE = "what is left of the last plan cannot be flown"


@dataclass(frozen=True)
class TermCost:
    """Value of one term of J, weight included."""

    name: str
    """Name of the term."""
    value: float
    """Weight times value."""
    ms: float = field(compare=False)
    """Time that it takes [ms], measured: its value and gradient, the mean so far, where the fast planner evaluates it;
    its value alone, once, elsewhere."""


COST_FIELDS = {"collision": 0, "control": 1, "limits": 2, "outside": 2, "risk": 3, "movers": 4, "delay": 5}
"""Terms of this project, each with the index of the number of a PlanCost that has it."""


@dataclass(frozen=True)
class PlanCost:
    """Terms of J (paper Eq. 2), summed over the trajectory, weights included."""

    collision: float
    """Sum of density times distance travelled, over body points and steps [1]."""
    control: float
    """Sum of u' Gamma u."""
    limits: float
    """Penalties that keep the motion well defined, such as the thrust floor, and inside the box."""
    risk: float = 0.0
    """Expected loss by collisions due to noise, see terms/risk.py; 0 in the paper."""
    movers: float = 0.0
    """Cost of coming near announced movers, see terms/movers.py; 0 in the paper."""
    delay: float = 0.0
    """Cost of arriving later, of plans whose arrival is put off, see terms/delay.py; 0 in the paper."""
    added: tuple[TermCost, ...] = ()
    """Terms that were added to these."""

    @classmethod
    def of(cls, terms: Iterable[TermCost]) -> "PlanCost":
        """Collect evaluated terms by their names."""
        own, added = [0.0] * len({*COST_FIELDS.values()}), []
        for term in terms:
            if term.name in COST_FIELDS:
                own[COST_FIELDS[term.name]] += term.value
            else:
                added.append(term)
        return cls(*own, added=tuple(added))

    @property
    def total(self) -> float:
        """Sum of all terms: J."""
        own = self.collision + self.control + self.limits + self.risk + self.movers + self.delay
        return own + sum(term.value for term in self.added)


@dataclass(frozen=True)
class PlanStep:
    """One iteration of a planner."""

    iteration: int
    """Counted from 0."""
    trajectory: Trajectory
    """Trajectory after this iteration."""
    motion: Motion
    """States and actions of the robot along it."""
    cost: PlanCost
    """J of this trajectory."""
    start_index: int = 0
    """Index of the first guess from which this trajectory comes."""
    restart: Restart | None = None
    """Reason why the plan was made anew; None for a first plan, and for one that continues the last one."""

    def end(self, outcome: PlanOutcome) -> "PlanResult":
        """Make this step the result of planning."""
        return PlanResult(**{part.name: getattr(self, part.name) for part in fields(PlanStep)}, outcome=outcome)


@dataclass(frozen=True)
class PlanResult(PlanStep):
    """Result of planning: the best trajectory, its motion and cost, and the outcome."""

    outcome: PlanOutcome = field(kw_only=True)
    """End of planning: a plan can be flown if this is FLYABLE."""

    def as_step(self) -> PlanStep:
        """Drop the outcome, for a planner that goes on from here."""
        return PlanStep(**{part.name: getattr(self, part.name) for part in fields(PlanStep)})


PlanSteps = Generator[PlanStep, None, PlanResult]
"""Planner at work: yields its iterations, and returns its result, which counts as the last iteration."""
