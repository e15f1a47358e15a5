"""What a flight is: where to, who flies, and how."""

from collections.abc import Callable
from dataclasses import dataclass, field
from time import perf_counter

from nerfnav.estimator import Estimator, FilterConfig, LastingError, StateNoise
from nerfnav.field import Field
from nerfnav.navigation.backup import Guard
from nerfnav.navigation.orders import Orders
from nerfnav.navigation.realtime import Clock
from nerfnav.navigation.recovery import RecoveryConfig, Relocaliser
from nerfnav.planner import Planner
from nerfnav.robots import Motion, RigidState


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
    recovery: RecoveryConfig = field(default_factory=RecoveryConfig)
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
class Mission:
    """What is to be flown, from where the simulator stands."""

    goal: RigidState
    """Where the robot shall arrive."""
    steps: int = 20
    """Time steps of the first plan (paper: 20)."""
    dt: float = 0.1
    """Length of a time step [s] (paper: 0.1)."""
    plan: Motion | None = None
    """A first plan that is already made, from the start to the goal; None: plan now."""
    orders: Callable[[], Orders] = Orders
    """Asked at the beginning of each time step for what has changed meanwhile."""
    realtime: bool = False
    """Whether the world goes on while filter and planner compute (see navigation/realtime.py)."""
    clock: Clock = perf_counter
    """By which it is told how long they take [s]."""


@dataclass(frozen=True)
class Pilot:
    """Who flies."""

    planner: Planner
    """Finds the way."""
    estimator: Estimator
    """Says where the robot is."""
    relocaliser: Relocaliser | None = None
    """Finds a robot that is lost; None: lost is lost."""
    guard: Guard | None = None
    """Keeps a way to come to rest ready beside each plan; None: plans are flown whatever becomes of them."""
    seen: Field | None = None
    """What its camera sees, as a field; None: it needs no pictures."""
    lasting: LastingError = field(default_factory=LastingError)
    """By what this field shows its camera elsewhere, in picture after picture."""
