"""Supervisor: a state machine that holds, relocalizes, lands or ends a flight whose belief cannot be relied on.

A filter that rejects a picture (its innovation or its residual fails the test) returns the prediction. The supervisor
then widens the belief, so that the next picture may move it further. After several rejections in a row it runs global
localization, and the belief restarts where that finds the robot; until then the filter ignores pictures. In all states
that hold, the robot comes to rest by its believed velocity, which it knows better than its position; one that is BLIND
may move away from what is near, or back to its last view (looking.py).

TRANSITIONS is the whole machine: after each picture the first row that applies gives the action and the next state.
Two actions come from elsewhere: the safety filter takes BACKUP where it rejects a plan (fallback.py), and a flight
begins BLIND where its field shows the camera nothing (looking.py). `SupervisorMemory.after` counts what the conditions
of the rows need.

How wide a belief may be depends on the room: with c the clearance of the believed position, where the picture says
little at most the distance to the goal, `widest`, `sure` and `adrift` are multiplied by c / (3 `widest`), at least 1
and at most `open`. So a robot flies on while three standard deviations fit into its clearance. With a picture that
shows nothing, there is no room.
"""

from collections.abc import Callable, Generator
from dataclasses import dataclass, field, replace
from typing import NamedTuple, Protocol, runtime_checkable

import torch
from jaxtyping import UInt8
from torch import Tensor

from nerfnav.core.errors import require_not_negative, require_positive
from nerfnav.estimator import Belief, FilterOutcome, Relocalisation, RelocaliseOutcome, RelocaliseResult, RelocaliseStep
from nerfnav.geometry import FORWARD_MOUNT, Pose
from nerfnav.navigation.supervisor_state import StateChange, SupervisorAction, SupervisorState, state_after
from nerfnav.planner import estimate_timing
from nerfnav.robots import Motion, RigidState, Robot, StateNoise

_EAGER = 4
"""Time steps of a robot that waits for a safe plan in each of which it looks for one."""
_VIEWS = 100
"""Pictures whose beliefs are kept."""
SIGMAS = 3.0
"""Standard deviations of the position that have to fit into the clearance."""


@runtime_checkable
class Relocaliser(Protocol):
    """Global localization from one picture."""

    def relocalise(self, image: UInt8[Tensor, "height width 3"]) -> Relocalisation:
        """Search the whole field."""
        ...


class WidthLimits(NamedTuple):
    """Standard deviations of a coordinate of the position [m], see SupervisorConfig."""

    widest: float
    sure: float
    adrift: float


@dataclass(frozen=True)
class SupervisorConfig:
    """Thresholds of the supervisor: when to hold, when to search, and when to give up."""

    patience: int = 3
    """Pictures in a row that may disagree before the robot counts as lost."""
    searches: int = 9
    """Searches for a lost robot before the flight is given up: once around."""
    between: int = 3
    """Pictures from one search to the next, in which the robot turns: neighbours look alike."""
    widest: float = 0.04
    """Standard deviation of a coordinate of the position from which a robot that sees little is BLIND where there is no
    room [m]: the clearance of plans (planner/risk/tracking_error.py), and half of the distance to a goal that counts
    as reached. In the paper's noise it takes three pictures that show nothing."""
    sure: float = 0.03
    """The same for a robot that holds because of its position, which is BLIND whenever it sees nothing: above this, a
    weak picture that agrees with its belief does not end the state [m]. The sky agrees with any belief."""
    adrift: float = 0.12
    """The same from which a BLIND robot is searched for, as a lost one is [m]: three times `widest`, which is a
    standard deviation of its own already. A robot does not come to rest while it drifts, for it tilts, and knows its
    tilt no better than its position."""
    open: float = 3.0
    """Largest factor on these three, where there is room."""
    unseen_s: float = 0.5
    """Time without an informative picture after which a BLIND robot is searched for [s]. In the paper's noise, hovering
    drifts by 0.12 m per axis after 1 s, and by 0.7 m after 2 s."""
    lost_s: float = 1.0
    """The same after which a search counts as in vain [s]. A robot that drifts for longer can hardly be ended gently:
    in the paper's noise its velocity is off by 0.4 m/s per axis then."""
    back: float = 1.0
    """Largest speed at which it goes back to its last informative view [m/s]."""
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
    """Standard deviations of the belief after the robot was found, beyond those of the search: its velocities are
    hardly known, for it was flown on a wrong belief. With a tenth of this on the rates, the next pictures are rejected
    again."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for negative rates or standard deviations."""
        require_not_negative(turn=self.turn, adrift=self.adrift, unseen_s=self.unseen_s, lost_s=self.lost_s)
        require_positive(glance=self.glance, widest=self.widest, open=self.open, back=self.back)

    def limits(self, room: float) -> WidthLimits:
        """Return the limits on the width of a belief in a room [m]: the clearance, at most the distance to the goal."""
        factor = min(self.open, max(1.0, room / (SIGMAS * self.widest)))
        return WidthLimits(factor * self.widest, factor * self.sure, factor * self.adrift)


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
    waited: int = 0
    """Of those in which it held, the ones in which it waited for a safe plan."""
    disagreed: int = 0
    """Pictures since that disagreed, before any search."""
    searched: int = 0
    """Pictures since in the state SEARCHING in which a search may have been due."""
    distrusts: bool = False
    """True where only a search ends the state."""
    state: SupervisorState = SupervisorState.TRACKING
    """Present state."""
    unseen: int = 0
    """Time steps since the last informative picture."""
    seen: Belief | None = None
    """Belief after the last picture that updated it in more than a few directions; None: there was none yet."""
    seen_at: int = 0
    """Index of the time step of that picture."""
    views: tuple[Belief, ...] = ()
    """Beliefs after the last pictures, the oldest first: what views gave, whatever the field promises."""

    def after(
        self, index: int, plan: Motion, action: SupervisorAction | None, belief: Belief, informative: bool = True,
        updated: bool = True, late: bool = False,
    ) -> "SupervisorMemory":  # fmt: skip
        """Count one more time step, whose picture was `informative`, and `updated` the belief in more than a few
        directions; a `late` one had none."""
        known = replace(
            self, state=state_after(action), unseen=0 if informative else self.unseen + 1,
            seen=belief if updated else self.seen, seen_at=index if updated else self.seen_at,
            views=self.views if late else (*self.views[-_VIEWS:], belief),
        )  # fmt: skip
        if action is None or not action.holds:
            fresh = SupervisorMemory(plan, index, state=known.state, unseen=known.unseen)
            return replace(fresh, seen=known.seen, seen_at=known.seen_at, views=known.views)
        searched = action in (SupervisorAction.SEARCHED, SupervisorAction.ADRIFT)
        return replace(
            known, held=self.held + 1, unsure=self.unsure + action.doubts,
            waited=self.waited + (not action.doubts),
            disagreed=self.disagreed + (action is SupervisorAction.WIDENED and not late),
            searched=self.searched + (searched and not late),
            distrusts=self.distrusts or action is SupervisorAction.SEARCHED,
        )  # fmt: skip

    @property
    def is_replan_due(self) -> bool:
        """Check whether a robot that came to rest for want of a safe plan is to look for one again: in the first steps,
        then each time that it has waited as long again. In a large place the search of a path takes seconds, and at
        rest little changes."""
        return self.waited < _EAGER or self.waited.bit_count() == 1

    def steps_left(self, believed: RigidState, robot: Robot) -> int:
        """Count the time steps to the end of the plan; for a robot that has stopped, as many as from rest."""
        left, dt = len(self.plan.actions) - 1, self.plan.dt
        if self.held == 0:
            return left
        corners = torch.cat([believed.position[None], self.plan.states.position[1:]])
        length = corners.diff(dim=0).norm(dim=-1).sum().item()
        return max(left, estimate_timing(robot, length, dt, dt).steps)


@dataclass(frozen=True)
class Evidence:
    """All that the supervisor learns in a time step."""

    index: int
    """Time step."""
    belief: Belief
    """Posterior of the filter."""
    outcome: FilterOutcome | None
    """Outcome of its update; None where it did not run."""
    image: UInt8[Tensor, "height width 3"] | None = None
    """Picture; None where none came."""
    search_requested: bool = False
    """By the operator."""
    doubt: str | None = None
    """Reason for which the belief is not trusted whatever the filter says (it is outside of the field's box, or a test
    of consistency fails); only a search ends it. None: there is no such reason."""
    room: float = 0.0
    """Clearance of the believed position, without an informative picture at most the distance to the goal [m]; 0 where
    it is unknown."""
    may_land: Callable[[], bool] = lambda: False
    """Check whether the robot can land gently below; it takes time, and is called for a lost robot only."""


class Situation(NamedTuple):
    """Conditions of TRANSITIONS after a picture."""

    state: SupervisorState  # until now
    disagrees: bool  # the picture does, and more may before the robot counts as lost
    doubt: str | None  # reason for which only a search ends the state
    rejected: int  # pictures that disagreed, this one included
    is_search_due: bool  # a robot that is not found is searched for in every few pictures, once around
    is_in_vain: bool  # the robot is given up unless this search finds it
    search_requested: bool  # by the operator
    is_uncertain: bool  # the belief is too wide to fly on
    is_adrift: bool  # it is so wide, or no picture was informative for so long, that it is worth a search
    may_search: bool  # there is a relocaliser, and a picture to search with
    deviation: float  # largest standard deviation of a coordinate of the position [m]
    limits: WidthLimits  # on that, here
    unseen_s: float  # time since the last informative picture [s]
    may_land: Callable[[], bool]  # gently, on the ground below

    @property
    def cause(self) -> str:
        """Reason for which the robot is searched for, with its numbers."""
        return self.doubt or (
            f"no informative picture for {self.unseen_s:.1f} s; standard deviation of the position "
            f"{self.deviation:.2f} m, at most {self.limits.adrift:.2f} m here"
        )


class Transition(NamedTuple):
    """Row of TRANSITIONS: a condition, given that none of the rows above applies, and the action that follows."""

    applies: Callable[[Situation], bool]
    action: SupervisorAction | None
    reason: str
    """Reason of a change of state, a format of a Situation."""
    searches: bool = False
    """True where global localization runs first: RELOCALISED where it finds the robot; else `action`, or where that is
    None, the rows below."""


_WIDTH = "standard deviation of the position {0.deviation:.2f} m, at most {0.limits.widest:.2f} m here"
_A, _S = SupervisorAction, SupervisorState
TRANSITIONS = (
    Transition(lambda now: now.state is _S.LANDING, _A.LANDED, ""),
    Transition(lambda now: now.state is _S.LOST, _A.LOST, ""),
    Transition(lambda now: now.disagrees, _A.WIDENED, "pictures that disagree with the belief: {0.rejected}"),
    Transition(lambda now: now.is_in_vain, None, "", searches=True),
    Transition(lambda now: now.is_in_vain and now.may_land(), _A.LANDED, "searched in vain: {0.cause}"),
    Transition(lambda now: now.is_in_vain, _A.LOST, "searched in vain: {0.cause}"),
    Transition(lambda now: now.doubt is not None and now.is_search_due, _A.SEARCHED, "{0.doubt}", searches=True),
    Transition(lambda now: now.doubt is not None, _A.SEARCHED, "{0.doubt}"),
    Transition(lambda now: now.search_requested, None, "", searches=True),
    Transition(lambda now: not now.is_uncertain, None, "the picture agrees with the belief, which is sure: " + _WIDTH),
    Transition(lambda now: now.is_adrift and now.is_search_due, _A.ADRIFT, "{0.cause}", searches=True),
    Transition(lambda now: now.is_adrift, _A.ADRIFT, "{0.cause}"),
    Transition(lambda now: True, _A.BLIND, "the picture says too little: " + _WIDTH),
)
"""All transitions after a picture, in order of precedence; the state that follows is that of the action."""
_FOUND = "global localization found the robot"


@dataclass(frozen=True)
class Decision:
    """Decision of the supervisor in a time step."""

    belief: Belief
    """Belief to go on with."""
    action: SupervisorAction | None
    """Action; None while nothing is wrong."""
    change: StateChange | None
    """Change of the state; None where it stays."""


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
        self, evidence: Evidence, memory: SupervisorMemory
    ) -> Generator[RelocaliseStep | RelocaliseResult, None, Decision]:
        """Decide on belief and action after an update of the filter; yield the steps of searches."""
        now, belief, action, reason = self._assess(evidence, memory), evidence.belief, None, ""
        for applies, action, reason, searches in TRANSITIONS:
            if not applies(now):
                continue
            found = (yield from self.search(belief, evidence.image)) if searches and now.may_search else None
            if found is not None:
                belief, action, reason = found, SupervisorAction.RELOCALISED, _FOUND
            if found is not None or action is not None or not searches:
                break
        if action is SupervisorAction.WIDENED:
            belief = replace(belief, covariance=belief.covariance * self.config.widen**2)
        after = state_after(action)
        changed = after is not now.state
        change = StateChange(evidence.index, now.state, after, reason.format(now)) if changed else None
        return Decision(belief, action, change)

    def _assess(self, evidence: Evidence, memory: SupervisorMemory) -> Situation:
        """Assess the situation; a robot that holds because of its position must be surer, and see something."""
        config, deviation, requested = self.config, evidence.belief.position_std, evidence.search_requested
        sees_nothing = evidence.outcome is FilterOutcome.PREDICTED_ONLY  # plain pictures look alike everywhere
        limits = config.limits(0.0 if sees_nothing else evidence.room)
        unseen_s = memory.unseen * memory.plan.dt
        uncertain = (
            sees_nothing or deviation > (limits.sure if sees_little(evidence.outcome) else limits.widest)
            if memory.unsure > 0
            else sees_little(evidence.outcome) and deviation > limits.widest
        ) or (sees_nothing and unseen_s >= config.unseen_s)
        rejected = evidence.outcome is FilterOutcome.DIVERGED
        count, doubt = memory.disagreed + rejected, evidence.doubt
        if doubt is None and memory.distrusts:
            doubt = "the belief is not trusted"
        elif doubt is None and rejected and (count >= config.patience or requested):
            doubt = f"pictures that disagree with the belief: {count}"
        rounds, since = divmod(memory.searched, config.between)
        adrift = deviation > limits.adrift or unseen_s >= config.unseen_s
        exhausted = memory.searched > 0 and (rounds + 1 >= config.searches or unseen_s >= config.lost_s)
        hopeless = doubt is not None and (exhausted or self.relocaliser is None)
        return Situation(
            state=memory.state,
            disagrees=rejected and doubt is None,
            doubt=doubt,
            rejected=count,
            is_search_due=since == 0 or requested,
            is_in_vain=hopeless or (exhausted and uncertain and adrift),
            search_requested=requested,
            is_uncertain=uncertain,
            is_adrift=adrift,
            may_search=self.relocaliser is not None
            and evidence.image is not None
            and (doubt is not None or requested or not sees_nothing),
            deviation=deviation,
            limits=limits,
            unseen_s=unseen_s,
            may_land=evidence.may_land,
        )

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
        covariance = self.config.found.covariance() + found.state_covariance(self.mount)
        return Belief(belief.mean.moved_to(found.step.body_poses(self.mount)[0]), covariance)


def sees_little(outcome: FilterOutcome | None) -> bool:
    """Check whether the filter learned little from a picture, or nothing."""
    return outcome in (FilterOutcome.WEAK, FilterOutcome.PREDICTED_ONLY)
