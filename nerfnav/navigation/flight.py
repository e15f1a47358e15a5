"""Flight: request (goal, time steps), navigation stack (planner, estimator, ...), configuration, and context.

The request and the stack stay the same during a flight. Before each time step the operator may request a new goal, a
gust, a kidnapping or a search; the active goal follows from that.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from time import perf_counter

import torch
from jaxtyping import Bool
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.estimator import ConsiderCovariance, Estimator, FilterConfig
from nerfnav.field import Field, GridField
from nerfnav.geometry import Pose
from nerfnav.navigation.fallback import SafetyFilter
from nerfnav.navigation.gust import GustStrength
from nerfnav.navigation.seen_movers import SeenMovers
from nerfnav.navigation.simulator import Simulator
from nerfnav.navigation.supervisor import Relocaliser, Supervisor, SupervisorConfig
from nerfnav.navigation.watch import Watch
from nerfnav.planner import FieldPlanner, Planner
from nerfnav.robots import Motion, RigidState, StateNoise

HiddenFunction = Callable[[Pose, float], Bool[Tensor, "height width"]]
"""Pixels that movers cover in the picture from T_world_camera at a time of the flight [s]."""


@dataclass(frozen=True)
class OperatorRequests:
    """Requests of the operator for the next time step."""

    goal: RigidState | None = None
    """New goal; None: the goal stays."""
    gust: GustStrength | StateNoise | None = None
    """Disturbance of this time step, on top of the usual one."""
    kidnap_pose: Pose | None = None
    """T_world_body to which the robot is moved at the end of this time step, before its picture."""
    search: bool = False
    """Whether to run global localization on the picture of this time step, even if nothing seems wrong."""
    stack: "NavigationStack | None" = None
    """Stack for this time step and all later ones, in a field that has changed; None: it stays."""


@dataclass(frozen=True)
class ActiveGoal:
    """Goal of the plans of a flight, with the heading that was chosen for it."""

    goal: RigidState
    """State at which the robot shall arrive."""
    since: int = 0
    """Time step at which this became the goal."""
    end: RigidState | None = None
    """The goal with a heading in which the camera sees something; None: not chosen yet, the goal's own counts."""
    keeps_headings: bool = False
    """Whether plans keep the headings of the plan before, which were chosen for what they show."""

    def replaced_by(self, goal: RigidState | None, index: int) -> "ActiveGoal":
        """Return the active goal after a request at time step `index`; None requests none."""
        if goal is None or (
            torch.equal(goal.position, self.goal.position) and torch.equal(goal.rotation, self.goal.rotation)
        ):
            return self
        return ActiveGoal(goal, since=index)

    @property
    def plan_end(self) -> RigidState:
        """State at which the next plan ends."""
        return self.end or self.goal


@dataclass(frozen=True)
class NavigateConfig:
    """Configuration of a flight; the planner of the stack has its own."""

    filter: FilterConfig = field(default_factory=FilterConfig)
    """State estimation; in open loop, `process_noise` alone counts."""
    noise: StateNoise = field(default_factory=StateNoise)
    """Noise of the true robot in each step (paper: 2 cm, 0.02 rad, half on the rates)."""
    initial: StateNoise = field(default_factory=lambda: StateNoise.isotropic(0.01**2))
    """Error of the first belief, and its covariance: 1 cm, 0.01 rad (paper: covariance 0.1 I)."""
    look_first: bool = True
    """Whether the robot takes a picture before it leaves (paper: no), so that it does not rely on the given start."""
    goal_tolerance_m: float = 0.08
    """REACHED when the believed position is this near to the goal [m], with two standard deviations to spare."""
    minimum_horizon: int = 6
    """Fewest steps of a plan: to meet the goal exactly in less takes wild thrust when noise has pushed the robot."""
    timeout_factor: float = 3.0
    """TIMEOUT after this many times the planned steps; those in which the robot held count only beyond as many."""
    most_risk: float | None = None
    """TOO_RISKY, on the ground, where a flight by the first plan touches something with a higher probability than this,
    in a flight with a safety filter; None: any probability is accepted."""
    most_blind: float | None = None
    """TOO_RISKY, on the ground, where the robot is expected to see too little on a larger share of the first plan, 0 to
    1 (expected_belief.py); None: any share is accepted, and one that is not known always."""
    recovery: SupervisorConfig = field(default_factory=SupervisorConfig)
    """Supervision of the belief; DIVERGED when it does not recover."""
    in_sight: float = 0.4
    """Share of a picture with edges from which on it is as good as any: not the void, no blank wall. A robot that may
    choose its heading arrives with the one by which most is seen on its path, where that is clearly more than by the
    goal's; 0, as in the paper: with the goal's."""
    leash_m: float = 0.0
    """Largest distance of the believed position from the state that the last plan has led to by now, for the next plan
    to begin at that state [m]: a controller must track plans then, between steps. 0, as in the paper: plans begin at
    the believed state."""
    open_loop: bool = False
    """Fly the first plan blindly: no pictures, no replanning, beliefs moved by the dynamics alone."""
    imu: bool = False
    """The robot has an inertial unit, which measures turns and body rates (gyroscopes.py): noise of these is known. In
    the physical world it always has one."""
    fly_on: bool = False
    """Fly on after a contact with the ground truth, which is counted, as the paper's evaluation does; the outcome at
    the end is COLLIDED all the same. By default a contact ends the flight."""

    @classmethod
    def paper(cls) -> "NavigateConfig":
        """Return the paper's assumptions: covariance 0.1 I at the start and for the process noise, contacts counted."""
        return cls(
            filter=FilterConfig.paper(), initial=StateNoise.isotropic(0.1), look_first=False, in_sight=0.0, fly_on=True
        )

    def in_field(self, place: Field) -> "NavigateConfig":
        """Return the configuration with the noise and the floor of a field on a grid in its filter."""
        return replace(self, filter=self.filter.for_field(place.info)) if isinstance(place, GridField) else self


@dataclass(frozen=True)
class FlightRequest:
    """Request of a flight from the state of the simulator."""

    goal: RigidState
    """State at which the robot shall arrive."""
    steps: int = 20
    """Time steps of the first plan (paper: 20)."""
    dt: float = 0.1
    """Length of a time step [s] (paper: 0.1)."""
    plan: Motion | None = None
    """A first plan that is already made, from the start to the goal; None: plan now."""
    operator: Callable[[], OperatorRequests] = OperatorRequests
    """Called once before each time step."""
    realtime: bool = False
    """Whether the world goes on while filter and planner compute (see navigation/realtime.py)."""
    clock: Callable[[], float] = perf_counter
    """Measures how long filter and planner compute: seconds since any time."""


@dataclass(frozen=True)
class NavigationStack:
    """Planner and estimator of a robot, with what makes them safe."""

    planner: Planner
    """Plans and replans."""
    estimator: Estimator
    """Filters the state."""
    relocaliser: Relocaliser | None = None
    """Finds a robot that is lost; None: a lost robot stays lost."""
    safety_filter: SafetyFilter | None = None
    """Keeps a fallback trajectory ready beside each plan; None: plans are flown even where they are not safe."""
    camera_field: Field | None = None
    """Field that predicts what the camera sees, for the choice of headings; None: headings are not chosen."""
    map_error: ConsiderCovariance = field(default_factory=ConsiderCovariance)
    """Error of that field, the same in picture after picture."""
    hidden: HiddenFunction | None = None
    """Marks the pixels that announced movers cover; None: none does. Filters that take no such pixels compare all."""
    watch: Watch | None = None
    """Looks for what the field does not show; None: a robot knows of announced movers alone."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for a robot that watches, and whose planner knows no movers."""
        if self.watch is not None and not getattr(self.planner, "avoids_movers", False):
            raise InvalidInputError(
                "this planner knows no obstacles that move: take the planner 'fast', or leave --watch out"
            )

    def among(self, seen: SeenMovers | None) -> "NavigationStack":
        """Return the stack that keeps clear of seen movers, too."""
        movers = None if seen is None else seen.movers
        if movers is None or not isinstance(self.planner, FieldPlanner):
            return self
        planner, safety_filter = self.planner, self.safety_filter
        planner = replace(planner, movers=movers.beside(planner.movers))
        if safety_filter is not None:
            safety_filter = replace(safety_filter, movers=movers.beside(safety_filter.movers))
        return replace(self, planner=planner, safety_filter=safety_filter)


@dataclass(frozen=True)
class FlightContext:
    """All that stays the same during a flight."""

    request: FlightRequest
    simulator: Simulator
    stack: NavigationStack
    config: NavigateConfig
    generator: torch.Generator

    @property
    def supervisor(self) -> Supervisor:
        """Supervisor of the belief."""
        return Supervisor(self.stack.relocaliser, self.config.recovery, self.simulator.mount)
