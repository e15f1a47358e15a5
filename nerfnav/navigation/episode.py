"""Episode: the record of each time step of a flight, the flight stacked over time, its numbers, and its files.

NEES, the normalised estimation error squared, is e' Sigma^-1 e with e = x (-) mu in the tangent of the mean. Its
expectation is 12, the length of the tangent, when the covariance is consistent; more when the filter is overconfident.
(Bar-Shalom, Li, Kirubarajan, "Estimation with applications to tracking and navigation", 2001, section 5.4.)
"""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from enum import Enum
from itertools import zip_longest
from pathlib import Path
from typing import Any

import torch
from jaxtyping import Bool, Float, UInt8
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.core.files import open_npz, replace_file, write_npz
from nerfnav.estimator import (
    ELLIPSOID_95,
    Belief,
    Consistency,
    FilterOutcome,
    FilterResult,
    FilterStep,
    RelocaliseResult,
    RelocaliseStep,
)
from nerfnav.navigation.fallback import FallbackTrajectory
from nerfnav.navigation.seen_movers import SeenMovers
from nerfnav.navigation.supervisor_state import StateChange, SupervisorAction, SupervisorState, state_after
from nerfnav.planner import Movers, PlanStep
from nerfnav.planner.steps import Restart
from nerfnav.robots import ATTITUDE, POSITION, VELOCITY, Motion, RigidState

_STATE = tuple(field.name for field in fields(RigidState))
FORMAT, VERSION = "nerfnav episode", 1
"""Format and version in episode.json."""
_OFF_M, _IN_A_ROW = 0.05, 3
"""Error [m] and number of time steps in a row of a silent divergence."""


class EpisodeOutcome(Enum):
    """Outcome of a flight; the value is what a user reads."""

    REACHED = "the robot is at the goal"
    COLLIDED = "the robot touched the ground-truth mesh"
    OUTSIDE = "the robot left the field's box"
    LOST = "the robot was lost, and its supervisor ended the flight"
    DIVERGED = "the filter lost the robot"
    TIMEOUT = "the goal was not reached in time"
    NO_PLAN = "no plan leads to the goal"
    TOO_RISKY = "no way was found that is safe enough in the noise to come"
    STOPPED = "the flight was stopped on the way"

    @property
    def is_mishap(self) -> bool:
        """True where no vehicle should repeat the flight: the robot hit something, left the place, or was lost."""
        return self in (EpisodeOutcome.COLLIDED, EpisodeOutcome.OUTSIDE, EpisodeOutcome.LOST, EpisodeOutcome.DIVERGED)


@dataclass(frozen=True)
class ExpectedSigma:
    """Largest standard deviation of a coordinate expected along a plan, over its times (see expected_belief.py)."""

    median_m: float
    """Median [m]."""
    p95_m: float
    """95th percentile [m]."""
    max_m: float
    """Largest [m]."""
    blind_share: float
    """Share of the times at which the filter is less sure than the supervisor lets a robot fly on, 0 to 1."""


@dataclass(frozen=True)
class NavigationStep:
    """Record of one time step: action, picture, belief, new plan."""

    index: int
    """Time step, 0 is the start before any action."""
    time: float
    """[s]"""
    action: Float[Tensor, " a"] | None
    """The action that led here; None at index 0."""
    truth: RigidState
    """True state."""
    belief: Belief
    """Believed state."""
    image: UInt8[Tensor, "height width 3"] | None
    """The picture; None in open loop, where none came, and at index 0 where the robot did not take one."""
    update: FilterResult | None
    """The last iteration of the filter, with its pixels; None where there was no picture."""
    plan: Motion
    """Plan from the mean of the belief, or the nearest state that the robot can be in; in open loop the rest of the
    first plan, whatever the belief."""
    touched: bool
    """Whether the body met the ground truth on the way here; False where there is no ground truth."""
    filter_ms: float
    """Time of the filter [ms]."""
    replan_ms: float
    """Time of the planner [ms]."""
    outcome: EpisodeOutcome | None = None
    """Outcome of the flight where it ends here; None while it goes on."""
    restart: Restart | None = None
    """Reason for which the plan was made anew in this step; None where it continues the last one."""
    recovery: SupervisorAction | None = None
    """Action of the supervisor; None while nothing is wrong."""
    change: StateChange | None = None
    """Change of the supervisor's state; None where it stays."""
    late: bool = False
    """Whether filter and planner were still at an earlier step: the robot flew blind, by an older plan."""
    hits_expected: float | None = None
    """Collisions by noise along the first plan as J counts them, at index 0: too many. None without a safety filter."""
    collision_probability: float | None = None
    """Probability that a flight by the first plan touches something, at index 0; None without a safety filter."""
    expected_sigma: ExpectedSigma | None = None
    """Sigma that the views along the first plan promise, at index 0; None where it is unknown (expected_belief.py)."""
    fallback: FallbackTrajectory | None = None
    """Fallback trajectory beside the plan; None without a safety filter, and where the robot holds."""
    apparent: Belief | None = None
    """Belief of the state that the field shows, without the map error; None: `belief`, which has it."""
    first_plan: Motion | None = None
    """Plan from the given start to the goal, with which the flight began, at index 0; None at later ones."""
    gust_mps: float | None = None
    """Change of speed by a gust on the way here [m/s]; 0 where the robot had no clearance for one, None without one."""
    consistency: Consistency | None = None
    """Consistency monitor of the filter; None in open loop, at index 0, and of filters whose noise is not scaled."""
    seen: SeenMovers | None = None
    """Things that pictures show and the field does not; None where the robot does not watch."""
    kept_movers: Movers | None = None
    """Boxes of these things in a step that was read from a file."""

    @property
    def seen_movers(self) -> Movers | None:
        """Boxes of these things; None where there are none."""
        return self.kept_movers if self.seen is None else self.seen.movers

    @property
    def filter_belief(self) -> Belief:
        """Belief from which the estimator continues."""
        return self.belief if self.apparent is None else self.apparent

    @property
    def filter_outcome(self) -> FilterOutcome | None:
        """Outcome of the filter's update; None where it did not run."""
        return None if self.update is None else self.update.outcome

    @property
    def state(self) -> SupervisorState:
        """State of the supervisor."""
        return state_after(self.recovery)

    @property
    def holds(self) -> bool:
        """Check whether the robot comes to rest and waits, for lack of a position or of a safe plan."""
        return self.recovery is not None and self.recovery.holds


Iteration = PlanStep | FilterStep
"""Iteration of planner or filter within a time step."""
FlightStep = Iteration | RelocaliseStep | RelocaliseResult | NavigationStep
"""All that `navigate` yields, in the order in which it happens."""


@dataclass(frozen=True)
class Episode:
    """Flight stacked over the times 0, dt, ..., n dt."""

    truth: RigidState
    """True states; batch shape (n + 1,)."""
    beliefs: Belief
    """Beliefs; batch shape (n + 1,)."""
    actions: Float[Tensor, "n a"]
    """Action of each step."""
    plans: tuple[Motion, ...]
    """Plan at each of the n + 1 times; plans are of different lengths."""
    touched: Bool[Tensor, " n+1"]
    """Whether the body met the ground truth on the way to each time."""
    filter_ms: Float[Tensor, " n+1"]
    """Time of the filter [ms]."""
    replan_ms: Float[Tensor, " n+1"]
    """Time of the planner [ms]; the first is that of the first plan."""
    dt: float
    """Length of a step [s]."""
    outcome: EpisodeOutcome
    """Outcome of the flight."""
    recoveries: tuple[SupervisorAction | None, ...] = ()
    """Action of the supervisor at each time; shorter where it is unknown."""
    late: tuple[int, ...] = ()
    """Time steps that passed while filter and planner were still at an earlier one, in real time."""
    first_plan: Motion | None = None
    """Plan with which the flight began, from the given start; None in files of versions that did not keep it."""
    transitions: tuple[StateChange, ...] = ()
    """Changes of the supervisor's state, the end of the flight included. In files of versions that did not keep their
    reasons, these are the actions."""
    consistency: dict[str, Any] | None = None
    """Numbers of the filter's consistency monitor at the end; None where there is none."""
    expected_sigma: ExpectedSigma | None = None
    """Sigma that the views along the first plan promised; None where that was not known."""

    @classmethod
    def of(cls, steps: Sequence[NavigationStep]) -> "Episode":
        """Stack the steps of a flight, all or the first ones (then the outcome is STOPPED)."""
        if not steps:
            raise InvalidInputError("an episode needs at least one navigation step")
        actions = [step.action for step in steps if step.action is not None]
        outcome = steps[-1].outcome or EpisodeOutcome.STOPPED
        actions_taken = tuple(step.recovery for step in steps)
        reasons = {index: step.change.reason for index, step in enumerate(steps) if step.change is not None}
        return cls(
            RigidState.stack([step.truth for step in steps]),
            Belief.stack([step.belief for step in steps]),
            torch.stack(actions) if actions else steps[0].plan.actions[:0],
            tuple(step.plan for step in steps),
            torch.tensor([step.touched for step in steps]),
            torch.tensor([step.filter_ms for step in steps]),
            torch.tensor([step.replan_ms for step in steps]),
            steps[0].plan.dt,
            outcome,
            actions_taken,
            tuple(step.index for step in steps if step.late),
            steps[0].first_plan,
            _transitions(actions_taken, outcome, reasons),
            None if steps[-1].consistency is None else steps[-1].consistency.numbers,
            steps[0].expected_sigma,
        )

    @property
    def times(self) -> Float[Tensor, " times"]:
        """Times of the steps [s]."""
        return self.dt * torch.arange(len(self.touched))

    @property
    def goal(self) -> RigidState:
        """Last goal: a goal may move, and the plans of a robot that holds lead to none."""
        led = [
            plan.states[-1]
            for plan, recovery in zip_longest(self.plans, self.recoveries)
            if (recovery is None or not recovery.holds) and plan.states.position[-1].isfinite().all()
        ]
        return led[-1] if led else self.plans[0].states[-1]

    def errors(self) -> Float[Tensor, "times 12"]:
        """Compute e = truth (-) mean at each time, in the tangent of the mean."""
        return self.beliefs.mean.local(self.truth)

    def nees(self) -> Float[Tensor, " times"]:
        """Compute the normalised estimation error squared at each time."""
        errors = self.errors().double()
        return (errors * torch.linalg.solve(self.beliefs.covariance.double(), errors)).sum(-1).float()

    def is_silent(self) -> bool:
        """Check for silent divergence, see `is_silent`."""
        errors, covariance = self.errors()[1:, POSITION].double(), self.beliefs.covariance[1:, POSITION, POSITION]
        squares = (errors * torch.linalg.solve(covariance.double(), errors)).sum(-1)
        actions = (*self.recoveries, *[None] * len(self.touched))[1 : len(self.touched)]
        tracking = [state_after(action) is SupervisorState.TRACKING for action in actions]
        return is_silent(errors.norm(dim=-1).tolist(), (squares < ELLIPSOID_95).tolist(), tracking)

    def metrics(self) -> dict[str, Any]:
        """Compute the numbers of the flight, as `nerfnav fly --json` prints them; None where there are none.

        Errors and times are those of the n steps; the start, before any picture, is left out.
        """
        return {
            "outcome": self.outcome.name.lower(),
            "steps": len(self.actions),
            "final_position_error_m": (self.truth.position[-1] - self.goal.position).norm().item(),
            "mesh_collision_steps": int(self.touched.sum()),
            "silent": self.is_silent(),
            "late_steps": len(self.late),
            "recoveries": {kind.name.lower(): self.recoveries.count(kind) for kind in SupervisorAction},
            "transitions": [change.to_json() for change in self.transitions],
            "expected_sigma": None if self.expected_sigma is None else asdict(self.expected_sigma),
            "estimation": self._estimation(),
            "timing_ms": self._timing_ms(),
        } | ({} if self.consistency is None else {"consistency": self.consistency})

    def _estimation(self) -> dict[str, float | None]:
        errors, nees = self.errors()[1:], self.nees()[1:]
        parts = {"position_rmse_m": POSITION, "rotation_rmse_rad": ATTITUDE, "velocity_rmse": VELOCITY}
        rmse = {name: errors[:, part].square().sum(-1).mean().sqrt() for name, part in parts.items()}
        return {name: _number(value) for name, value in (rmse | {"nees_mean": nees.mean()}).items()}

    def _timing_ms(self) -> dict[str, float | None]:
        seen = [index for index in range(1, len(self.touched)) if index not in self.late]
        parts = {"replan": self.replan_ms, "filter": self.filter_ms, "step": self.replan_ms + self.filter_ms}
        return {
            f"{name}_p{percent}": _number(times[seen].quantile(percent / 100)) if seen else None
            for name, times in parts.items()
            for percent in (50, 95)
        }

    def save(self, folder: Path) -> tuple[Path, ...]:
        """Write episode.npz and episode.json into a folder, which is made where it is missing; return both."""
        folder.mkdir(parents=True, exist_ok=True)
        arrays = _arrays("truth", self.truth) | _arrays("belief", self.beliefs.mean)
        arrays |= _arrays("plan", RigidState.cat([plan.states for plan in self.plans]))
        arrays |= {
            "belief.covariance": self.beliefs.covariance,
            "plan.actions": torch.cat([plan.actions for plan in self.plans]),
            "plan.steps": torch.tensor([len(plan.actions) for plan in self.plans]),
            "actions": self.actions,
            "touched": self.touched,
            "filter_ms": self.filter_ms,
            "replan_ms": self.replan_ms,
        }
        if self.first_plan is not None:
            arrays |= _arrays("first_plan", self.first_plan.states) | {"first_plan.actions": self.first_plan.actions}
        about = {"format": FORMAT, "version": VERSION, "dt": self.dt, **self.metrics()}
        about["recovery_of_step"] = [None if kind is None else kind.name.lower() for kind in self.recoveries]
        about["late"] = list(self.late)
        numbers, words = folder / "episode.npz", folder / "episode.json"
        write_npz(numbers, {name: value.numpy() for name, value in arrays.items()})
        with replace_file(words) as stream:
            stream.write((json.dumps(about, indent=2, allow_nan=False) + "\n").encode())
        return numbers, words

    @classmethod
    def load(cls, folder: Path) -> "Episode":
        """Read what `save` wrote. Raises InvalidInputError for a folder that holds no readable episode."""
        try:
            about = json.loads((folder / "episode.json").read_text())
            if (about["format"], about["version"]) != (FORMAT, VERSION):
                raise ValueError(f"it has format {about['format']!r}, version {about['version']!r}")
            with open_npz(folder / "episode.npz") as stored:
                return _unpacked({name: torch.from_numpy(array) for name, array in stored.items()}, about)
        except FileNotFoundError as error:
            raise InvalidInputError(f"there is no episode in {folder}: {error.filename} is missing") from error
        except (ValueError, LookupError, TypeError, AttributeError, RuntimeError, OSError) as error:
            raise InvalidInputError(f"{folder} holds no readable {FORMAT} of version {VERSION}: {error}") from error


def _transitions(
    actions: Sequence[SupervisorAction | None], outcome: EpisodeOutcome, reasons: dict[int, str]
) -> tuple[StateChange, ...]:
    """List the changes of state by the actions of a flight; a reason that is missing is that of the action."""
    state, changes = SupervisorState.TRACKING, []
    for index, action in enumerate(actions):
        before, state = state, state_after(action)
        if state is not before:
            reason = "the belief is sure enough again" if action is None else action.value
            changes.append(StateChange(index, before, state, reasons.get(index, reason)))
    return (*changes, StateChange(max(0, len(actions) - 1), state, SupervisorState.ENDED, outcome.value))


def is_silent(errors_m: Sequence[float], inside_95: Sequence[bool], tracking: Sequence[bool]) -> bool:
    """Check for silent divergence: in three time steps in a row, while tracking, the estimated position is more than
    5 cm off, and the truth is outside of the belief's 95 % ellipsoid of position."""
    steps = zip(errors_m, inside_95, tracking, strict=True)
    silent = [off > _OFF_M and not inside and tracks for off, inside, tracks in steps]
    return any(all(silent[first : first + _IN_A_ROW]) for first in range(len(silent) - _IN_A_ROW + 1))


def _unpacked(stored: dict[str, Tensor], about: dict[str, Any]) -> Episode:
    lengths, dt = stored["plan.steps"].tolist(), float(about["dt"])
    parts = [stored[f"plan.{name}"].split([n + 1 for n in lengths]) for name in _STATE]
    states = [RigidState(*state) for state in zip(*parts, strict=True)]
    outcome, kept = EpisodeOutcome[about["outcome"].upper()], about.get("transitions")
    actions = tuple(
        None if name is None else SupervisorAction[name.upper()] for name in about.get("recovery_of_step", ())
    )
    return Episode(
        _state("truth", stored),
        Belief(_state("belief", stored), stored["belief.covariance"]),
        stored["actions"],
        tuple(Motion(*plan, dt) for plan in zip(states, stored["plan.actions"].split(lengths), strict=True)),
        stored["touched"],
        stored["filter_ms"],
        stored["replan_ms"],
        dt,
        outcome,
        actions,
        tuple(about.get("late", ())),
        _first_plan(stored, dt),
        _transitions(actions, outcome, {}) if kept is None else tuple(map(StateChange.from_json, kept)),
        about.get("consistency"),
        None if (expected := about.get("expected_sigma")) is None else ExpectedSigma(**expected),
    )


def _first_plan(stored: dict[str, Tensor], dt: float) -> Motion | None:
    actions = stored.get("first_plan.actions")
    return None if actions is None else Motion(_state("first_plan", stored), actions, dt)


def _arrays(prefix: str, state: RigidState) -> dict[str, Tensor]:
    return {f"{prefix}.{name}": getattr(state, name) for name in _STATE}


def _state(prefix: str, stored: dict[str, Tensor]) -> RigidState:
    return RigidState(*(stored[f"{prefix}.{name}"] for name in _STATE))


def _number(value: Tensor) -> float | None:
    return value.item() if value.isfinite() else None
