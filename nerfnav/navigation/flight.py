"""Flight: request (goal, time steps), navigation stack (planner, estimator, ...), configuration, and context.

The request and the stack stay as they are during a flight. What the operator asks of the next time step may change:
the goal, a gust, a robot put down elsewhere, a search. The active goal follows from that. The context joins these,
and says what the camera should see.
"""


from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from time import perf_counter

import torch

from nerfnav.estimator import ConsiderCovariance, Estimator, FilterConfig
from nerfnav.field import Field
from nerfnav.geometry import Pose
from nerfnav.navigation.fallback import SafetyFilter
from nerfnav.navigation.realtime import Clock
from nerfnav.navigation.simulator import Simulator
from nerfnav.navigation.supervisor import Relocaliser, Supervisor, SupervisorConfig
from nerfnav.planner import Planner, PlanResult, fits
from nerfnav.planner.active_yaw import YawObjective, choose_goal_heading, choose_headings
from nerfnav.planner.visibility import find_best_turn
from nerfnav.robots import Motion, RigidState, StateNoise


@dataclass(frozen=True)
class OperatorRequests:
    """What is asked of the flight for its next time step."""

    goal: RigidState | None = None
    """Where it shall arrive from now on; None: where it is going already."""
    gust: StateNoise | None = None
    """A disturbance that comes on top of the usual one in this time step."""
    carried: Pose | None = None
    """T_world_body at which a hand puts the robot down at the end of this time step, before it looks."""
    search: bool = False
    """Whether to look for the robot everywhere in the picture of this time step, even if nothing seems wrong."""


@dataclass(frozen=True)
class ActiveGoal:
    """Where a flight is going."""

    goal: RigidState
    """Where it shall arrive."""
    since: int = 0
    """The time step at which this became the goal."""
    end: RigidState | None = None
    """Where plans lead: there, with a heading in which something is seen; None: with the heading that it is told."""
    keeps_headings: bool = False
    """Whether plans keep the headings of those before, which were chosen for what they show."""

    def heeding(self, orders: OperatorRequests, index: int) -> "ActiveGoal":
        """The course after orders that came at time step `index`."""
        goal = orders.goal
        if goal is None or _same(goal, self.goal):
            return self
        return replace(self, goal=goal, since=index, end=None, keeps_headings=False)

    @property
    def leads_to(self) -> RigidState:
        """Where the next plan leads."""
        return self.end or self.goal

    def after(self, planned: PlanResult) -> "ActiveGoal":
        """The course after a plan, which has kept its headings unless it was made anew."""
        return replace(self, keeps_headings=self.keeps_headings and planned.restart is None)


def _same(one: RigidState, other: RigidState) -> bool:
    return torch.equal(one.position, other.position) and torch.equal(one.rotation, other.rotation)


@dataclass(frozen=True)
class NavigateConfig:
    """How a flight is flown; how it is planned is the pilot's planner's own."""

    filter: FilterConfig = field(default_factory=FilterConfig)
    """How the state is estimated; in open loop, `process_noise` alone counts."""
    noise: StateNoise = field(default_factory=StateNoise)
    """What disturbs the true robot at each step (paper: 2 cm, 0.02 rad, half on the rates)."""
    initial: StateNoise = field(default_factory=lambda: StateNoise.isotropic(0.01**2))
    """Spread of the first belief around the truth, and its covariance: 1 cm, 0.01 rad (paper: covariance 0.1 I)."""
    look_first: bool = True
    """Whether the robot takes a picture before it leaves (paper: no), so that it does not set out from where it only
    was told to be."""
    goal_tolerance_m: float = 0.08
    """REACHED when the believed position is this near to the goal [m]."""
    minimum_horizon: int = 6
    """Fewest steps of a plan: to meet the goal exactly in less takes wild thrust when noise has pushed the robot."""
    timeout_factor: float = 2.0
    """TIMEOUT after this many times the planned steps; those in which the robot held count only beyond as many."""
    most_hits: float | None = None
    """TOO_RISKY, on the ground, where more collisions than this are to be expected of noise along the first plan, of a
    flight with a guard; None: any number will do."""
    recovery: SupervisorConfig = field(default_factory=SupervisorConfig)
    """What is done when pictures disagree with the belief; DIVERGED when it does not help."""
    in_sight: float = 0.4
    """Share of a picture that has edges from which on it is as good as any: not the void, no blank wall. A robot that
    may turn as it likes arrives with the heading by which most is seen on its way, where that is clearly more than by
    the goal's; 0, as in the paper: with the goal's."""
    leash_m: float = 0.0
    """How far the believed position may be from where the last plan has led by now, for the next plan to begin there
    [m]: something must track plans then, between steps. 0, as in the paper: plans begin where the robot believes to
    be."""
    open_loop: bool = False
    """Fly the first plan blindly: no pictures, no replanning, beliefs moved by the dynamics alone."""

    @classmethod
    def paper(cls) -> "NavigateConfig":
        """The paper's assumptions: covariance 0.1 I at the start and for the process noise."""
        initial = StateNoise.isotropic(0.1)
        return cls(filter=FilterConfig.paper(), initial=initial, look_first=False, in_sight=0.0)


@dataclass(frozen=True)
class FlightRequest:
    """What is to be flown, from where the simulator stands."""

    goal: RigidState
    """Where the robot shall arrive."""
    steps: int = 20
    """Time steps of the first plan (paper: 20)."""
    dt: float = 0.1
    """Length of a time step [s] (paper: 0.1)."""
    plan: Motion | None = None
    """A first plan that is already made, from the start to the goal; None: plan now."""
    orders: Callable[[], OperatorRequests] = OperatorRequests
    """Asked at the beginning of each time step for what has changed meanwhile."""
    realtime: bool = False
    """Whether the world goes on while filter and planner compute (see navigation/realtime.py)."""
    clock: Clock = perf_counter
    """By which it is told how long they take [s]."""


@dataclass(frozen=True)
class NavigationStack:
    """Who flies."""

    planner: Planner
    """Finds the way."""
    estimator: Estimator
    """Says where the robot is."""
    relocaliser: Relocaliser | None = None
    """Finds a robot that is lost; None: lost is lost."""
    guard: SafetyFilter | None = None
    """Keeps a way to come to rest ready beside each plan; None: plans are flown whatever becomes of them."""
    seen: Field | None = None
    """What its camera sees, as a field; None: it needs no pictures."""
    lasting: ConsiderCovariance = field(default_factory=ConsiderCovariance)
    """By what this field shows its camera elsewhere, in picture after picture."""


@dataclass(frozen=True)
class FlightContext:
    """What does not change during a flight, but for the orders."""

    mission: FlightRequest
    simulator: Simulator
    pilot: NavigationStack
    config: NavigateConfig
    generator: torch.Generator
    orders: OperatorRequests = field(default_factory=OperatorRequests)
    """Of this time step alone."""

    @property
    def lookout(self) -> Supervisor:
        """What looks for the robot when it is lost."""
        return Supervisor(self.pilot.relocaliser, self.config.recovery, self.simulator.mount)

    @property
    def watch(self) -> YawObjective | None:
        """How the camera looks at what is there; None where that does not matter, and on the ground, where it takes
        room to turn, or leads elsewhere."""
        seen, enough, guard = self.pilot.seen, self.config.in_sight, self.pilot.guard
        if seen is None or enough == 0 or self.config.open_loop or self.simulator.robot.planar:
            return None
        may_be = partial(fits, seen if guard is None else guard.field, self.simulator.robot.body)
        return YawObjective(seen, enough, self.simulator.mount, may_be)

    def sees(self, state: RigidState) -> tuple[float, float]:
        """How much of enough the camera should see there, and by how much to turn to see more [rad]; see sight.py."""
        watch = self.watch
        return (1.0, 0.0) if watch is None else find_best_turn(watch.matter, state, watch.enough, watch.mount)

    def seeing(
        self, course: ActiveGoal, here: RigidState, rest: Motion, leads: bool = True
    ) -> tuple[ActiveGoal, Motion]:
        """The course with an end in which something is seen, and what is left of a plan with headings that show more.

        `rest` begins where the robot believes to be; whether it `leads` to the goal: else that is straight ahead. A
        robot that has nothing to look for arrives as it was told.
        """
        watch = self.watch
        if watch is None:
            return replace(course, end=course.goal), rest
        way = rest.states if leads else RigidState.stack([here, course.goal])
        sights, goal = watch.profile_along(way), course.leads_to
        end = choose_goal_heading(watch, sights, (here, goal))
        turned = choose_headings(watch, sights, rest, (here, goal, end), self.simulator.robot) if leads else None
        if turned is None:
            return replace(course, end=end, keeps_headings=False), rest
        return replace(course, end=turned.states[-1], keeps_headings=True), turned
