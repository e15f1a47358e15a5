"""Supervisor: a state machine that holds, widens the belief or relocalizes a robot whose pictures disagree with it.

A filter that rejects a picture (its innovation or its residual fails the test) returns the prediction. The supervisor
then widens the belief, so that the next picture may move it further. After several rejections in a row it runs global
localization, and the belief restarts where that finds the robot; until then the filter ignores pictures. In all states
that hold, the robot comes to rest by its believed velocity, which it knows better than its position.

TRANSITIONS is the whole machine: after each picture the first row that applies gives the next state. Two states come
from elsewhere: the safety filter enters BACKUP where it rejects a plan (fallback.py), and a flight begins BLIND where
its field shows the camera nothing (looking.py). `SupervisorMemory.after` counts what the conditions of the rows need.
"""

from collections.abc import Callable, Generator
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import NamedTuple, Protocol, runtime_checkable

import torch
from jaxtyping import UInt8
from torch import Tensor

from nerfnav.core.errors import require_not_negative, require_positive
from nerfnav.estimator import Belief, FilterOutcome, Relocalisation, RelocaliseOutcome, RelocaliseResult, RelocaliseStep
from nerfnav.geometry import FORWARD_MOUNT, Pose
from nerfnav.planner import estimate_timing
from nerfnav.robots import Motion, RigidState, Robot, StateNoise


@runtime_checkable
class Relocaliser(Protocol):
    """Global localization from one picture."""

    def relocalise(self, image: UInt8[Tensor, "height width 3"]) -> Relocalisation:
        """Search the whole field."""
        ...


class SupervisorState(Enum):
    """State of the supervisor after a time step, None while nothing is wrong; the value is what a user reads."""

    WIDENED = "the picture disagreed: the belief was widened, and the robot holds"
    BLIND = "the picture says too little for where the robot may be: it holds and looks around"
    ADRIFT = "the robot may be anywhere near, and was looked for everywhere and not found: it holds and looks around"
    SEARCHED = "the robot was looked for everywhere and not found: it holds and looks around"
    BACKUP = "the plan was no longer safe: the robot comes to rest in free space"
    RELOCALISED = "the robot was lost, and found again by looking everywhere"
    LOST = "the robot was lost, and not found again"

    @property
    def holds(self) -> bool:
        """Check whether the robot comes to rest and waits, for lack of a position or of a safe plan."""
        return self.doubts or self is SupervisorState.BACKUP

    @property
    def doubts(self) -> bool:
        """Check whether the robot holds because it does not know its position."""
        return self.turns or self is SupervisorState.WIDENED

    @property
    def turns(self) -> bool:
        """Check whether the robot turns while it holds, because its present view does not help."""
        return self in (SupervisorState.BLIND, SupervisorState.ADRIFT, SupervisorState.SEARCHED)


@dataclass(frozen=True)
class SupervisorConfig:
    """Thresholds of the supervisor: when to hold, and when to search."""

    patience: int = 3
    """Pictures in a row that may disagree before the robot counts as lost."""
    searches: int = 9
    """Searches for a lost robot before the flight is given up: once around."""
    between: int = 3
    """Pictures from one search to the next, in which the robot turns: neighbours look alike."""
    widest: float = 0.04
    """Standard deviation of a coordinate of the position from which a robot that sees little is BLIND [m]: the
    clearance of plans (planner/risk/tracking_error.py), and half of the distance to a goal that counts as reached. In
    the paper's noise it takes three pictures that show nothing."""
    sure: float = 0.03
    """The same for a robot that holds because of its position, which is BLIND whenever it sees nothing: above this, a
    picture that agrees with its belief is too weak to end the state [m]. The sky agrees with any belief."""
    adrift: float = 0.12
    """Standard deviation of a coordinate of the position from which a BLIND robot is searched for, as a lost one is
    [m]: three times `widest`, which is a standard deviation of its own already. A robot does not come to rest while it
    drifts, for it tilts, and knows its tilt no better than its position."""
    rest: int = 6
    """Steps of the plan of a robot that holds."""
    turn: float = 2.5
    """Yaw rate at which it looks all around [rad/s]."""
    glance: float = 6.0
    """Largest yaw rate at which it turns to a heading in which it should see something [rad/s]: half of the body rate
    limit of the paper's robot."""
    widen: float = 1.7
    """Factor on all standard deviations of the belief for each picture that disagrees."""
    found: StateNoise = field(default_factory=lambda: StateNoise(0.02, 2.0, 0.02, 3.0))
    """Standard deviations of the belief after the robot was found: its pose is known well, its velocities hardly, for
    it was flown on a wrong belief. With a tenth of this on the rates, the next pictures are rejected again."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for negative rates or standard deviations."""
        require_not_negative(turn=self.turn, adrift=self.adrift)
        require_positive(glance=self.glance)


@dataclass(frozen=True)
class SupervisorMemory:
    """Counts of time steps since the last plan that was made to lead to the goal."""

    plan: Motion
    """That plan."""
    planned_at: int = 0
    """Index of its time step."""
    held: int = 0
    """Time steps since, in which the robot held."""
    unsure: int = 0
    """Of these, those in which it did not know its position."""
    disagreed: int = 0
    """Pictures since that disagreed."""
    adrift: int = 0
    """Pictures since that were too weak for a robot whose position is that uncertain."""

    def after(self, index: int, plan: Motion, state: SupervisorState | None, late: bool = False) -> "SupervisorMemory":
        """Count one more time step; a `late` one had no picture."""
        if state is None or not state.holds:
            return SupervisorMemory(plan, index)
        disagreed = state in (SupervisorState.WIDENED, SupervisorState.SEARCHED) and not late
        return replace(
            self, held=self.held + 1, unsure=self.unsure + state.doubts, disagreed=self.disagreed + disagreed,
            adrift=self.adrift + (state is SupervisorState.ADRIFT and not late),
        )  # fmt: skip

    def steps_left(self, believed: RigidState, robot: Robot) -> int:
        """Count the time steps to the end of the plan; for a robot that has stopped, as many as from rest."""
        left, dt = len(self.plan.actions) - 1, self.plan.dt
        if self.held == 0:
            return left
        corners = torch.cat([believed.position[None], self.plan.states.position[1:]])
        length = corners.diff(dim=0).norm(dim=-1).sum().item()
        return max(left, estimate_timing(robot, length, dt, dt).steps)


class Situation(NamedTuple):
    """Conditions of TRANSITIONS after a picture."""

    disagrees: bool  # the picture does, or so many did before that only a search ends the state
    is_patient: bool  # more pictures may disagree before the robot counts as lost
    is_between_searches: bool  # a lost robot only turns in this picture
    is_last_search: bool  # a lost robot is given up unless this search finds it
    search_requested: bool  # by the operator
    is_uncertain: bool  # the belief is too wide to fly on
    is_adrift: bool  # so wide that it is worth a search, with a picture that shows something
    is_search_due: bool  # a robot adrift is searched for in every few pictures, once around


class Transition(NamedTuple):
    """Row of TRANSITIONS: a condition, given that none of the rows above applies, and the state that follows."""

    applies: Callable[[Situation], bool]
    state: SupervisorState | None
    searches: bool = False
    """Whether global localization runs first: RELOCALISED where it finds the robot; else `state`, or where that is
    None, the rows below."""


TRANSITIONS = (
    Transition(lambda now: now.disagrees and now.is_patient, SupervisorState.WIDENED),
    Transition(lambda now: now.disagrees and now.is_between_searches, SupervisorState.SEARCHED),
    Transition(lambda now: now.disagrees and now.is_last_search, SupervisorState.LOST, searches=True),
    Transition(lambda now: now.disagrees, SupervisorState.SEARCHED, searches=True),
    Transition(lambda now: now.search_requested, None, searches=True),
    Transition(lambda now: not now.is_uncertain, None),
    Transition(lambda now: not now.is_adrift, SupervisorState.BLIND),
    Transition(lambda now: now.is_search_due, SupervisorState.ADRIFT, searches=True),
    Transition(lambda now: True, SupervisorState.ADRIFT),
)
"""All transitions after a picture, in order of precedence."""


@dataclass(frozen=True)
class Supervisor:
    """Runs TRANSITIONS, with the relocaliser that its searches use."""

    relocaliser: Relocaliser | None
    """Global localization; None: a lost robot stays lost."""
    config: SupervisorConfig = field(default_factory=SupervisorConfig)
    """Thresholds."""
    mount: Pose = field(default_factory=lambda: FORWARD_MOUNT)
    """T_body_camera."""

    def supervise(
        self, belief: Belief, outcome: FilterOutcome | None, image: Tensor | None, memory: SupervisorMemory,
        search_requested: bool = False,
    ) -> Generator[RelocaliseStep | RelocaliseResult, None, tuple[Belief, SupervisorState | None]]:  # fmt: skip
        """Return the belief to go on with after an update of the filter, and the state; yield the steps of searches."""
        now, state = self._assess(belief, outcome, image is not None, memory, search_requested), None
        for applies, state, searches in TRANSITIONS:
            if not applies(now):
                continue
            found = (yield from self.search(belief, image)) if searches else None
            if found is not None:
                return found, SupervisorState.RELOCALISED
            if state is not None or not searches:
                break
        if state is SupervisorState.WIDENED:
            belief = replace(belief, covariance=belief.covariance * self.config.widen**2)
        return belief, state

    def _assess(
        self, belief: Belief, outcome: FilterOutcome | None, has_image: bool, memory: SupervisorMemory, requested: bool
    ) -> Situation:
        """Assess the situation; a robot that holds because of its position must be surer, and see something."""
        config, deviation = self.config, belief.position_std
        sees_nothing = outcome is FilterOutcome.PREDICTED_ONLY  # black and plain pictures look alike everywhere
        uncertain = (
            sees_nothing or deviation > config.sure
            if memory.unsure > 0
            else sees_little(outcome) and deviation > config.widest
        )
        overdue = memory.disagreed + 1 - config.patience  # pictures since the robot counts as lost
        searched, since = divmod(memory.adrift, config.between)
        return Situation(
            disagrees=outcome is FilterOutcome.DIVERGED or self.is_lost(memory),
            is_patient=overdue < 0 and not requested,
            is_between_searches=overdue % config.between > 0 and not requested,
            is_last_search=self.relocaliser is None or overdue // config.between + 1 >= config.searches,
            search_requested=requested,
            is_uncertain=uncertain,
            is_adrift=self.relocaliser is not None and has_image and not sees_nothing and deviation > config.adrift,
            is_search_due=since == 0 and searched < config.searches,
        )

    def is_lost(self, memory: SupervisorMemory) -> bool:
        """Check whether so many pictures have disagreed that only a search ends the state."""
        return memory.disagreed >= self.config.patience

    def search(
        self, belief: Belief, image: Tensor | None
    ) -> Generator[RelocaliseStep | RelocaliseResult, None, Belief | None]:
        """Run global localization; return the new belief, or None without a picture or a unique place."""
        if self.relocaliser is None or image is None:
            return None
        found = yield from self.relocaliser.relocalise(image)
        yield found
        if found.outcome is not RelocaliseOutcome.FOUND:
            return None
        return Belief(belief.mean.moved_to(found.step.body_poses(self.mount)[0]), self.config.found.covariance())


def sees_little(outcome: FilterOutcome | None) -> bool:
    """Check whether the filter learned little from a picture, or nothing."""
    return outcome in (FilterOutcome.WEAK, FilterOutcome.PREDICTED_ONLY)
