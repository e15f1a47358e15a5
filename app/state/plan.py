"""Plan state: the plan as far as it is computed, its settings, and the commands on it."""

from dataclasses import dataclass, field, fields, replace
from enum import Enum
from typing import Any, ClassVar

from nerfnav.core.errors import InvalidInputError
from nerfnav.field import UnknownSpace
from nerfnav.navigation import ExpectedSigma
from nerfnav.obstacles import ObstacleSet
from nerfnav.planner import (
    FLYABLE,
    RISK,
    CostWeights,
    PlanCost,
    PlannerConfig,
    PlanOutcome,
    PlanResult,
    PlanStep,
    planners,
)
from nerfnav.robots import Motion
from nerfnav_app.jobs.events import PlannerResult
from nerfnav_app.places.ends import Ends
from nerfnav_app.state.flight import FlightSettings

_SHORTEST_S, LONGEST_S = 0.5, 600.0
_HEAVIEST, _MOST_SAMPLES, _WIDEST_M = 1e6, 16, 0.2
_MODERATE_FROM, _HIGH_ABOVE, _HIGH_BLIND_ABOVE = 0.01, 0.1, 0.25
NO_TRAJECTORY = (PlanOutcome.NO_PATH, PlanOutcome.TIME_LIMIT, PlanOutcome.DIVERGED)
"""Outcomes of plans that hold no trajectory from start to goal."""


class RiskLevel(Enum):
    """Levels of a risk; the value is the word for it."""

    LOW = "low"
    MODERATE = "moderate"
    HIGH = "high"


def classify_risk(probability: float) -> RiskLevel:
    """Classify a collision probability, 0 to 1: low under 1 %, high above 10 %."""
    if probability < _MODERATE_FROM:
        return RiskLevel.LOW
    return RiskLevel.HIGH if probability > _HIGH_ABOVE else RiskLevel.MODERATE


def classify_blindness(share: float) -> RiskLevel:
    """Classify the share of a plan with too little to see, 0 to 1: low where there is none, high above a quarter."""
    if share == 0:
        return RiskLevel.LOW
    return RiskLevel.HIGH if share > _HIGH_BLIND_ABOVE else RiskLevel.MODERATE


@dataclass(frozen=True)
class StartPlan:
    """Optimise a trajectory between the ends."""


@dataclass(frozen=True)
class StartComparison:
    """Plan between the ends with every planner."""


@dataclass(frozen=True)
class DeclineFlight:
    """Do not fly an unsafe plan after all."""


@dataclass(frozen=True)
class AllowTime:
    """Plan again with a longer duration."""

    seconds: float
    """From start to goal [s]."""


@dataclass(frozen=True)
class RestoreWeights:
    """Plan again with the default weights."""


@dataclass(frozen=True)
class HighlightPlanner:
    """Highlight the plan of one planner of a comparison."""

    name: str | None
    """The planner; None highlights none."""


@dataclass(frozen=True)
class EndComparison:
    """Take the plans of a comparison of planners away."""


PlanAction = DeclineFlight | AllowTime | RestoreWeights | HighlightPlanner | EndComparison


@dataclass(frozen=True)
class PlanSettings:
    """Settings of plans: duration, accepted risk, unseen space and weights."""

    duration_s: float = 2.0
    """Time from start to goal [s]."""
    shortest: bool = False
    """Search the shortest duration that keeps the robot's limits instead."""
    max_collision: float | None = None
    """Largest accepted bound on the probability of a collision, 0 to 1; None accepts any."""
    unknown: UnknownSpace = UnknownSpace.OCCUPIED
    """Occupancy that is assumed of space that no camera saw."""
    weights: CostWeights = field(default_factory=CostWeights)
    """Weights of the terms of J; a weight of risk in it, as stored by earlier versions, comes before `risk_weight`."""
    risk_weight: float = RISK
    """Cost of a collision by noise [J], for planners that count it; 0 keeps room around the body instead."""
    paper_cost: bool = False
    """Minimise the paper's Eq. 2 alone: no noise model, no room for noise, no choice of headings."""

    def with_duration(self, seconds: float) -> "PlanSettings":
        """Set the duration [s], without a search for the shortest."""
        return replace(self, duration_s=seconds, shortest=False)

    def check(self) -> None:
        """Raise InvalidInputError, which names the range, for a number that no plan can have."""
        if not _SHORTEST_S <= self.duration_s <= LONGEST_S:
            raise InvalidInputError(f"the duration must be from {_SHORTEST_S:g} to {LONGEST_S:g} s")
        if self.max_collision is not None and not 0 < self.max_collision <= 1:
            raise InvalidInputError("the accepted risk must be above 0 % and at most 100 %")
        if not 0 <= self.risk_weight <= _HEAVIEST:
            raise InvalidInputError(f"risk weight must be from 0 to {_HEAVIEST:g} J")
        most = {"samples_per_step": _MOST_SAMPLES, "margin": _WIDEST_M}
        for part in fields(self.weights):
            value, largest = getattr(self.weights, part.name), most.get(part.name, _HEAVIEST)
            least = 1 if part.name == "samples_per_step" else 0
            if not least <= value <= largest:
                raise InvalidInputError(f"{part.name.replace('_', ' ')} must be from {least:g} to {largest:g}")

    @property
    def has_default_cost(self) -> bool:
        """True where no weight of J was changed."""
        return self.default_cost() == self

    def default_cost(self) -> "PlanSettings":
        """Restore the default weights of J."""
        return replace(self, weights=CostWeights(), risk_weight=RISK, paper_cost=False)

    def config(self, planner: str, own: PlannerConfig | None) -> PlannerConfig | None:
        """Merge the weights into the planner's settings; `own` is returned where all weights are the default."""
        weights = replace(self.weights, risk=0.0)
        if weights == CostWeights():
            return own
        return replace(planners.load(planner).config() if own is None else own, weights=weights)

    def flight_config(self, planner: str, own: PlannerConfig | None) -> PlannerConfig | None:
        """Choose the planner's settings in flight; None for its own, or those of the paper's cost."""
        entry = planners.load(planner)
        settings, risk = self.config(planner, own) or entry.config(), self.weights.risk or self.risk_weight
        return None if risk == RISK or self.paper_cost else entry.in_flight(settings, risk)


@dataclass(frozen=True)
class CostHistory:
    """Cost by term over the iterations, thinned to a bounded length."""

    LIMIT: ClassVar[int] = 400

    iterations: tuple[int, ...] = ()
    """Iterations at which the cost is kept."""
    costs: tuple[PlanCost, ...] = ()
    """Cost at each of them."""
    stride: int = 1
    """Iterations between two entries."""

    def appended(self, iteration: int, cost: PlanCost) -> "CostHistory":
        """Add an entry, unless the stride skips it; beyond LIMIT entries every other one is dropped."""
        if iteration % self.stride:
            return self
        longer = CostHistory((*self.iterations, iteration), (*self.costs, cost), self.stride)
        if len(longer.iterations) <= self.LIMIT:
            return longer
        return CostHistory(longer.iterations[::2], longer.costs[::2], 2 * self.stride)


@dataclass(frozen=True)
class PlanRecord:
    """A plan as far as it is computed."""

    TRAIL: ClassVar[int] = 6
    """Number of earlier iterations that are kept."""
    RECORDED: ClassVar[int] = 300
    """Number of iterations that can be replayed."""
    REPLAY_S: ClassVar[float] = 2.0
    """Duration of a replay [s]."""
    QUICK_S: ClassVar[float] = 0.5
    """Plans that took longer were visible while they were computed, and are not replayed [s]."""

    ends: Ends
    """Start and goal of the request."""
    planner: str = "fast"
    """Planner of the request."""
    settings: PlanSettings = field(default_factory=PlanSettings)
    """Settings of the request."""
    flight: FlightSettings = field(default_factory=FlightSettings)
    """Settings of the flight that the plan is for: its noise and its world count in the plan."""
    field_made_by: str = ""
    """`Session.field_made_by` at that time; empty where it is not known."""
    obstacles: ObstacleSet | None = field(default=None, hash=False)
    """Obstacles in the place at that time."""
    draft: bool = False
    """True for a plan that follows the hand while it drags an end or an obstacle: it is not checked for safety."""
    refusal: str = ""
    """Reason why there is no plan for a later request."""
    latest: PlanStep | None = None
    """The last iteration so far."""
    trail: tuple[Motion, ...] = ()
    """A few earlier iterations, oldest first."""
    history: CostHistory = CostHistory()
    """Cost by term."""
    summary: dict[str, Any] = field(default_factory=dict, hash=False)
    """Figures of the job, once it has finished."""
    recorded: tuple[PlanStep, ...] = ()
    """The first iterations: the replay of a plan that was computed too fast to be watched."""
    replayed: float | None = None
    """Share of the recording that was replayed, 0 to 1; None while there is no replay."""

    @property
    def outcome(self) -> PlanOutcome | None:
        """None while it is computed, or when it was stopped."""
        return self.latest.outcome if isinstance(self.latest, PlanResult) else None

    @property
    def is_good(self) -> bool:
        """True for a finished and checked plan that may be flown."""
        return self.outcome in FLYABLE and not self.draft

    @property
    def is_unsafe(self) -> bool:
        """True for a finished plan that is not to be flown."""
        return self.outcome is not None and self.outcome not in FLYABLE

    @property
    def collision_probability(self) -> float | None:
        """Probability that a flight by the plan touches something, 0 to 1; None where it was not estimated."""
        return self.summary.get("collision_probability")

    @property
    def expected_sigma(self) -> ExpectedSigma | None:
        """Sigma that the views along the plan promise; None where it was not estimated."""
        expected = self.summary.get("expected_sigma")
        return None if expected is None else ExpectedSigma(**expected)

    @property
    def is_risky(self) -> bool:
        """True where a flight by the plan touches something with a high probability."""
        probability = self.collision_probability
        return probability is not None and classify_risk(probability) is RiskLevel.HIGH

    @property
    def is_blind(self) -> bool:
        """True where there is too little to see somewhere along the plan, of which users are warned."""
        expected = self.expected_sigma
        return expected is not None and expected.blind_share > 0

    @property
    def is_mostly_blind(self) -> bool:
        """True where there is too little to see on a large share of the plan."""
        expected = self.expected_sigma
        return expected is not None and classify_blindness(expected.blind_share) is RiskLevel.HIGH

    @property
    def leads(self) -> bool:
        """True where it holds a trajectory from start to goal, safe or not."""
        return self.latest is not None and self.outcome not in NO_TRAJECTORY

    @property
    def shown(self) -> PlanStep | None:
        """The iteration to show now."""
        if self.replayed is None or not self.recorded:
            return self.latest
        return self.recorded[min(int(self.replayed * len(self.recorded)), len(self.recorded) - 1)]

    @property
    def shown_trail(self) -> tuple[Motion, ...]:
        """Earlier iterations to show with it, oldest first."""
        if self.replayed is None:
            return self.trail
        count = min(int(self.replayed * len(self.recorded)), len(self.recorded) - 1)
        return tuple(self.recorded[index].motion for index in range(max(0, count - self.TRAIL), count))

    @property
    def without_replay(self) -> "PlanRecord":
        """The finished plan in little memory: of each initial guess, the last iteration alone is kept."""
        last = tuple({step.start_index: step for step in self.recorded}.values())
        return replace(self, recorded=last, trail=(), replayed=None)

    @property
    def others(self) -> tuple[Motion, ...]:
        """Final trajectories of the other initial guesses, if there were several; the best one is the plan."""
        best = None if self.latest is None else self.latest.start_index
        ends = {step.start_index: step.motion for step in self.recorded}
        return tuple(motion for start, motion in ends.items() if start != best)

    def with_step(self, step: PlanStep) -> "PlanRecord":
        """Add an iteration; iterations 1, 2, 4, 8, ... stay visible, as the line moves most early on."""
        trail = self.trail
        if self.latest is not None and step.iteration & (step.iteration - 1) == 0:
            trail = (*trail, self.latest.motion)[-self.TRAIL :]
        recorded = (*self.recorded, step) if len(self.recorded) < self.RECORDED else self.recorded
        history = self.history.appended(step.iteration, step.cost)
        return replace(self, latest=step, trail=trail, history=history, recorded=recorded)


@dataclass(frozen=True, kw_only=True)
class PlanState:
    """The plan and its settings: part of a Session."""

    plan_settings: PlanSettings = field(default_factory=PlanSettings)
    """Settings of the next plan."""
    plan: PlanRecord | None = None
    """The last plan."""
    unconfirmed: PlanRecord | None = None
    """An unsafe plan that the user asked to fly: the confirmation is pending."""
    comparison: tuple[PlannerResult, ...] = ()
    """Results of the last comparison of planners, as far as it has come."""
    highlighted: str | None = None
    """Planner whose line is drawn stronger than the others of a comparison."""

    @property
    def replaying(self) -> bool:
        """True while a plan is replayed at a pace that a person can follow."""
        return self.plan is not None and self.plan.replayed is not None
