"""Records of a plan, of a search for the robot and of a flight, as far as they have come.

The actions are those of a person on a plan that is not to be flown.
"""


from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

from nerfnav.estimator import FilterStep, RelocaliseOutcome, RelocaliseStep
from nerfnav.navigation import EpisodeOutcome, NavigationStep
from nerfnav.planner import FLYABLE, PlanCost, PlanOutcome, PlanResult, PlanStep
from nerfnav.robots import Motion, RigidState
from nerfnav_app.places.ends import Ends
from nerfnav_app.state.settings import PlanSettings


@dataclass(frozen=True)
class DeclineFlight:
    """Do not fly a plan that is not safe, after all."""


@dataclass(frozen=True)
class AllowTime:
    """Plan again, with more time."""

    seconds: float
    """From start to goal [s]."""


@dataclass(frozen=True)
class RestoreWeights:
    """Plan again, with the weights as they were at first."""


PlanAction = DeclineFlight | AllowTime | RestoreWeights


NO_TRAJECTORY = (PlanOutcome.NO_PATH, PlanOutcome.TIME_LIMIT, PlanOutcome.DIVERGED)
"""Outcomes of plans that are no way from start to goal."""


@dataclass(frozen=True)
class CostHistory:
    """Cost by term over the iterations, thinned so that it stays short."""

    LIMIT: ClassVar[int] = 400

    iterations: tuple[int, ...] = ()
    """At which iterations the cost is kept."""
    costs: tuple[PlanCost, ...] = ()
    """The cost there."""
    stride: int = 1
    """Iterations between two entries."""

    def appended(self, iteration: int, cost: PlanCost) -> "CostHistory":
        """With one more entry, unless the stride skips it; beyond LIMIT entries every other one is dropped."""
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
    """How many earlier iterations are kept."""
    RECORDED: ClassVar[int] = 300
    """How many iterations can be replayed."""
    REPLAY_S: ClassVar[float] = 2.0
    """How long a replay takes [s]."""
    QUICK_S: ClassVar[float] = 0.5
    """Plans that took longer were watched while they were made, and are not replayed [s]."""

    ends: Ends
    """What it was asked to join."""
    planner: str = "fast"
    """Who was asked."""
    settings: PlanSettings = field(default_factory=PlanSettings)
    """How it was asked to be."""
    draft: bool = False
    """Whether it only follows a hand that still moves an end: nobody has judged it."""
    refusal: str = ""
    """Why there is none for what was asked later."""
    latest: PlanStep | None = None
    """The last iteration so far."""
    trail: tuple[Motion, ...] = ()
    """A few earlier iterations, oldest first."""
    history: CostHistory = CostHistory()
    """Cost by term."""
    summary: dict[str, Any] = field(default_factory=dict)
    """The job's numbers, once it has finished."""
    recorded: tuple[PlanStep, ...] = ()
    """The first iterations: what a replay shows of a plan that was made faster than a person can follow."""
    replayed: float | None = None
    """How much of the recording has been shown again, 0 to 1; None while there is no replay."""

    @property
    def outcome(self) -> PlanOutcome | None:
        """None while it is computed, or when it was stopped."""
        return self.latest.outcome if isinstance(self.latest, PlanResult) else None

    @property
    def is_good(self) -> bool:
        """Whether it is finished and nothing is known against flying it."""
        return self.outcome in FLYABLE and not self.draft

    @property
    def is_unsafe(self) -> bool:
        """Whether it has ended with something that is not to be flown."""
        return self.outcome is not None and self.outcome not in FLYABLE

    @property
    def leads(self) -> bool:
        """Whether it is a way from start to goal at all, be it a bad one."""
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
    def others(self) -> tuple[Motion, ...]:
        """Where the other first guesses have led, if there were several; the best one is the plan."""
        best = None if self.latest is None else self.latest.start_index
        ends = {step.start_index: step.motion for step in self.recorded}
        return tuple(motion for start, motion in ends.items() if start != best)

    def with_step(self, step: PlanStep) -> "PlanRecord":
        """With one more iteration; iterations 1, 2, 4, 8, ... stay visible, as the line moves most early on."""
        trail = self.trail
        if self.latest is not None and step.iteration & (step.iteration - 1) == 0:
            trail = (*trail, self.latest.motion)[-self.TRAIL :]
        recorded = (*self.recorded, step) if len(self.recorded) < self.RECORDED else self.recorded
        history = self.history.appended(step.iteration, step.cost)
        return replace(self, latest=step, trail=trail, history=history, recorded=recorded)


@dataclass(frozen=True)
class LocalizationRecord:
    """A search for the robot as far as it has come."""

    NEAR: ClassVar[int] = 4
    """For so many time steps, what it found stays in sight."""

    step: RelocaliseStep
    """The likeliest poses so far."""
    at: int
    """How many time steps the flight had then."""
    outcome: RelocaliseOutcome | None = None
    """None while the search goes on."""

    def in_sight(self, steps: int) -> bool:
        """Whether it is still to be seen where the flight shows so many time steps."""
        return abs(steps - self.at) <= self.NEAR


@dataclass(frozen=True)
class FlightRecord:
    """A flight as far as it has gone."""

    ends: Ends
    """What it was asked to join."""
    steps: tuple[NavigationStep, ...] = ()
    """Time steps so far."""
    plan: Motion | None = None
    """What the robot intends now."""
    guess: RigidState | None = None
    """Where the filter is while it works on a picture; None between pictures."""
    doing: str = ""
    """What the time step in progress is at, for the user."""
    summary: dict[str, Any] = field(default_factory=dict)
    """The job's numbers, once it has finished."""
    gusts: tuple[int, ...] = ()
    """Time steps in which a gust was asked for; not known of stored flights."""
    goals_moved: tuple[int, ...] = ()
    """Time steps in which the goal was moved; not known of stored flights."""

    @property
    def outcome(self) -> EpisodeOutcome | None:
        """None while it flies, or when it was stopped."""
        return self.steps[-1].outcome if self.steps else None

    @property
    def times(self) -> tuple[float, ...]:
        """Of the steps [s]."""
        return tuple(index * self.tick for index in range(len(self.steps)))

    @property
    def tick(self) -> float:
        """Length of a step [s]."""
        return self.steps[0].plan.dt

    def cut(self, at: int) -> "FlightRecord":
        """Up to time step `at`."""
        return replace(self, steps=self.steps[: at + 1], plan=self.steps[at].plan, guess=None, doing="")

    def with_step(self, step: NavigationStep) -> "FlightRecord":
        """With one more time step."""
        return replace(self, steps=(*self.steps, step), plan=step.plan, guess=None, doing="")

    def with_iteration(self, step: PlanStep | FilterStep | RelocaliseStep) -> "FlightRecord":
        """With one more iteration of what happens within a time step."""
        if isinstance(step, RelocaliseStep):
            return replace(self, doing="looking for the robot everywhere")
        if isinstance(step, FilterStep):
            return replace(self, guess=step.mean, doing="comparing its picture with the field")
        return replace(self, plan=step.motion, doing="planning the rest of the way")
