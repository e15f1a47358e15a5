"""Settings: the choice of robot, planner and estimator, the settings of plans, the settings of flights."""

from dataclasses import dataclass, field, fields, replace

from nerfnav import robots
from nerfnav.core.errors import InvalidInputError
from nerfnav.estimator import estimators
from nerfnav.field import UnknownSpace
from nerfnav.navigation import WorldName
from nerfnav.planner import CostWeights, PlannerConfig, planners
from nerfnav.robots import StateNoise

GUST = StateNoise(position_m=0.05, velocity_mps=0.3, attitude_rad=0.05, body_rate_radps=0.3)
"""What one gust of wind does to the robot."""
LARGEST_SEED = 2**31 - 1
"""Seeds are whole numbers from 0 to this."""
_SHORTEST_S, LONGEST_S = 0.5, 600.0
_HEAVIEST, _MOST_SAMPLES, _WIDEST_M = 1e6, 16, 0.2


@dataclass(frozen=True)
class Choice:
    """What moves, what plans and what estimates."""

    robot: str = "quadrotor"
    """One of `nerfnav.robots.names()`, or the path of a robot's file."""
    planner: str = "fast"
    """One of `nerfnav.planner.planners.names()`."""
    estimator: str = "fast"
    """One of `nerfnav.estimator.estimators.names()`."""

    def check(self) -> None:
        """Raise UnknownNameError, which lists what exists, for a name that nothing has.

        InvalidInputError for a robot that cannot be, or does not move by itself.
        """
        robots.load(self.robot).require_planned()
        planners.load(self.planner)
        estimators.load(self.estimator)


@dataclass(frozen=True)
class PlanSettings:
    """How long plans take, and what they weigh."""

    duration_s: float = 2.0
    """How long the robot may take from start to goal [s]."""
    shortest: bool = False
    """Whether to find the shortest duration that keeps the robot's limits instead."""
    max_collision: float | None = None
    """Largest bound on the probability of a collision that is accepted, 0 to 1; None accepts any."""
    unknown: UnknownSpace = UnknownSpace.OCCUPIED
    """What space is taken for that no camera ever saw into."""
    weights: CostWeights = field(default_factory=CostWeights)
    """What the terms of J weigh."""

    def lasting(self, seconds: float) -> "PlanSettings":
        """The same with this duration [s], and none to be found."""
        return replace(self, duration_s=seconds, shortest=False)

    def check(self) -> None:
        """Raise InvalidInputError for numbers that no plan can have: they are typed, and the notice tells the range."""
        if not _SHORTEST_S <= self.duration_s <= LONGEST_S:
            raise InvalidInputError(f"the duration must be from {_SHORTEST_S:g} to {LONGEST_S:g} s")
        if self.max_collision is not None and not 0 < self.max_collision <= 1:
            raise InvalidInputError("the accepted risk must be above 0 % and at most 100 %")
        most = {"samples_per_step": _MOST_SAMPLES, "margin": _WIDEST_M}
        for part in fields(self.weights):
            value, largest = getattr(self.weights, part.name), most.get(part.name, _HEAVIEST)
            least = 1 if part.name == "samples_per_step" else 0
            if not least <= value <= largest:
                raise InvalidInputError(f"{part.name.replace('_', ' ')} must be from {least:g} to {largest:g}")

    def config(self, planner: str, own: PlannerConfig | None) -> PlannerConfig | None:
        """The planner's settings with these weights; `own` where nobody changed the weights."""
        if self.weights == CostWeights():
            return own
        return replace(planners.load(planner).config() if own is None else own, weights=self.weights)


@dataclass(frozen=True)
class FlightSettings:
    """What a person may change about flights."""

    seed: int = 0
    """Seed of everything random."""
    position_noise_m: float = StateNoise.position_m
    """Standard deviation of what disturbs each coordinate of the position at each time step [m]."""
    attitude_noise_rad: float = StateNoise.attitude_rad
    """The same of the attitude [rad]; velocity and body rate are disturbed by half as much in their units."""
    open_loop: bool = False
    """Fly the first plan blindly."""
    world: WorldName = "paper"
    """The paper's noise, or the physical world, whose disturbances are its own."""
    realtime: bool = False
    """Whether the world goes on while filter and planner compute."""
    pace: float = 0.0
    """How many times faster than in reality a flight may go; 0 is as fast as it is computed."""

    @property
    def noise(self) -> StateNoise:
        """What disturbs the robot at each time step, its rates by half as much (as in the paper)."""
        position, attitude = self.position_noise_m, self.attitude_noise_rad
        return StateNoise(position, 0.5 * position, attitude, 0.5 * attitude)
