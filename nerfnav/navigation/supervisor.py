"""Supervisor: widen the belief, then relocalize, when pictures disagree with it.

A filter that rejects a picture (its innovation or its residual fails the test) hands the prediction back. The belief
is then widened, so that the next picture may move it further; when several pictures in a row were rejected, a
relocaliser searches the whole field, and the belief begins anew where it finds the robot; until then, pictures say
nothing to the filter. Meanwhile the robot holds: it comes to rest by what it believes of its velocity, which it knows
better than its place.
"""

from collections.abc import Callable, Generator
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Protocol, runtime_checkable

import torch
from jaxtyping import UInt8
from torch import Tensor

from nerfnav.core.errors import require_not_negative, require_positive
from nerfnav.estimator import Belief, FilterOutcome, Relocalisation, RelocaliseOutcome, RelocaliseResult, RelocaliseStep
from nerfnav.geometry import FORWARD_MOUNT, Pose
from nerfnav.robots import Motion, RigidState, Robot, StateNoise

LITTLE = (FilterOutcome.WEAK, FilterOutcome.PREDICTED_ONLY)
"""Outcomes of updates that learned little, or nothing."""


@runtime_checkable
class Relocaliser(Protocol):
    """Anything that finds a camera from one picture alone."""

    def relocalise(self, image: UInt8[Tensor, "height width 3"]) -> Relocalisation:
        """Search; returns the outcome."""
        ...


class SupervisorState(Enum):
    """What was done about a picture that disagreed; the value is what a user reads."""

    WIDENED = "the picture disagreed: the belief was widened, and the robot holds"
    BLIND = "the picture says too little for where the robot may be: it holds and looks around"
    ADRIFT = "the robot may be anywhere near, and was looked for everywhere and not found: it holds and looks around"
    SEARCHED = "the robot was looked for everywhere and not found: it holds and looks around"
    BACKUP = "the plan was no longer safe: the robot comes to rest in free space"
    RELOCALISED = "the robot was lost, and found again by looking everywhere"
    LOST = "the robot was lost, and not found again"

    @property
    def holds(self) -> bool:
        """Whether the robot comes to rest and waits, for it does not know where it is, or no way on."""
        return self.doubts or self is SupervisorState.BACKUP

    @property
    def doubts(self) -> bool:
        """Whether it does not know where it is."""
        return self in (
            SupervisorState.WIDENED,
            SupervisorState.BLIND,
            SupervisorState.ADRIFT,
            SupervisorState.SEARCHED,
        )

    @property
    def turns(self) -> bool:
        """Whether it looks somewhere else meanwhile, for what it sees does not help."""
        return self in (SupervisorState.BLIND, SupervisorState.ADRIFT, SupervisorState.SEARCHED)


@dataclass(frozen=True)
class SupervisorConfig:
    """When to doubt and when to search."""

    patience: int = 3
    """Pictures in a row that may disagree before the robot counts as lost."""
    searches: int = 9
    """Times that a lost robot is looked for everywhere before it is given up: once around."""
    between: int = 3
    """Pictures from one search to the next, in which the robot turns: neighbours look alike."""
    widest: float = 0.04
    """Standard deviation of a coordinate of the position from which a robot that sees little is BLIND [m]: what plans
    keep clear of (planner/risk/tracking_error.py), and half of what may be missing to a goal. In the paper's noise that
    is after three pictures that show nothing."""
    sure: float = 0.03
    """The same for a robot in doubt, which is BLIND whenever it sees nothing: above this, a picture that agrees with
    its belief tells too little to end the doubt [m]. The sky agrees with any."""
    adrift: float = 0.12
    """Standard deviation of a coordinate of the position from which a BLIND robot is looked for everywhere, as a lost
    one is [m]: three times `widest`, which is a standard deviation of its own already. It does not come to rest while
    it drifts, for it tilts, and knows its tilt no better than its place."""
    rest: int = 6
    """Steps that a robot which holds looks ahead."""
    turn: float = 2.5
    """With which it looks all around [rad/s]."""
    glance: float = 6.0
    """With which it turns at most to where it should see something [rad/s]: half of the body rate that the paper's
    robot may have."""
    widen: float = 1.7
    """Factor on all standard deviations of the belief for each picture that disagrees."""
    found: StateNoise = field(default_factory=lambda: StateNoise(0.02, 2.0, 0.02, 3.0))
    """Spread of the belief after the robot was found: its pose is known well, its velocities hardly, for it was flown
    on a wrong belief; a tenth of this on the rates, and the next pictures are rejected again."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for rates to turn with, or a spread to search from, that are none."""
        require_not_negative(turn=self.turn, adrift=self.adrift)
        require_positive(glance=self.glance)


@dataclass(frozen=True)
class Supervisor:
    """What looks for a robot that is lost."""

    relocaliser: Relocaliser | None
    """Searches; None: lost is lost."""
    config: SupervisorConfig = field(default_factory=SupervisorConfig)
    """When."""
    mount: Pose = field(default_factory=lambda: FORWARD_MOUNT)
    """T_body_camera."""

    def recover(
        self, belief: Belief, image: Tensor | None, lost: int, at_once: bool = False
    ) -> Generator[RelocaliseStep | RelocaliseResult, None, tuple[Belief, SupervisorState]]:
        """The belief to go on with after `lost` pictures in a row disagreed, and what was done.

        Yields the steps of a search, if it is time for one, or one is wanted at once.
        """
        config = self.config
        if not self.is_lost(lost) and not at_once:
            return replace(belief, covariance=belief.covariance * config.widen**2), SupervisorState.WIDENED
        searched, since = divmod(lost - config.patience, config.between)
        if since and not at_once:
            return belief, SupervisorState.SEARCHED
        found = yield from self.search(belief, image)
        if found is not None:
            return found, SupervisorState.RELOCALISED
        last = self.relocaliser is None or searched + 1 >= config.searches
        return belief, SupervisorState.LOST if last else SupervisorState.SEARCHED

    def is_lost(self, disagreed: int) -> bool:
        """Whether so many pictures have disagreed that only a search can end the doubt."""
        return disagreed >= self.config.patience

    def is_blind(self, belief: Belief, outcome: FilterOutcome | None, doubts: bool) -> bool:
        """Whether a robot whose picture did not disagree had better look around all the same."""
        if doubts:
            return outcome is FilterOutcome.PREDICTED_ONLY or belief.position_std > self.config.sure
        return outcome in LITTLE and belief.position_std > self.config.widest

    def look_around(
        self, belief: Belief, image: Tensor | None, adrift: int
    ) -> Generator[RelocaliseStep | RelocaliseResult, None, tuple[Belief, SupervisorState]]:
        """What is done for a BLIND robot: the belief to go on with, and the name of it.

        `adrift` pictures before have left it as wide as `SupervisorConfig.adrift`, those not counted that showed
        nothing (None). It is searched for in every few of them, once around; pictures are believed meanwhile, for none
        of them disagreed.
        """
        config = self.config
        if self.relocaliser is None or image is None or belief.position_std <= config.adrift:
            return belief, SupervisorState.BLIND
        searched, since = divmod(adrift, config.between)
        found = None if since or searched >= config.searches else (yield from self.search(belief, image))
        return (belief, SupervisorState.ADRIFT) if found is None else (found, SupervisorState.RELOCALISED)

    def search(
        self, belief: Belief, image: Tensor | None
    ) -> Generator[RelocaliseStep | RelocaliseResult, None, Belief | None]:
        """Look everywhere, whatever is believed; the new belief, or None where not one place alone looks right, or no
        picture came."""
        if self.relocaliser is None or image is None:
            return None
        found = yield from self.relocaliser.relocalise(image)
        yield found
        if found.outcome is not RelocaliseOutcome.FOUND:
            return None
        return Belief(belief.mean.moved_to(found.step.body_poses(self.mount)[0]), self.config.found.covariance())


def come_to_rest(
    robot: Robot, start: RigidState, steps: int, dt: float, turn: Callable[[RigidState], float] | None = None
) -> Motion:
    """What a robot does in `steps` steps of `dt` [s] that holds: brake, then stay, and turn with `turn` [rad/s] of its
    state."""
    states, actions = [start], []
    for _ in range(steps):
        actions.append(robot.hold(states[-1], dt, 0.0 if turn is None else turn(states[-1])))
        states.append(robot.step(states[-1], actions[-1], dt))
    return Motion(RigidState.stack(states), torch.stack(actions), dt)
