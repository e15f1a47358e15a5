"""Flight state: the flight and the search for the robot as far as they have come, settings, and commands in flight."""

from collections.abc import Hashable
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

from nerfnav.estimator import FilterStep, RelocaliseOutcome, RelocaliseStep
from nerfnav.navigation import EpisodeOutcome, GustStrength, NavigationStep, WorldName
from nerfnav.obstacles import ObstacleSet
from nerfnav.planner import PlanStep
from nerfnav.robots import Motion, RigidState, StateNoise
from nerfnav_app.places.ends import Ends
from nerfnav_app.state.tracks import TrackRecord

LARGEST_GUST = GustStrength(position_m=0.05, velocity_mps=0.3, attitude_rad=0.05, body_rate_radps=0.3)
"""Gust with clearance all around; scaled down with less."""
LARGEST_SEED = 2**31 - 1
"""Seeds are whole numbers from 0 to this."""


@dataclass(frozen=True)
class StartFlight:
    """Fly from start to goal with the camera alone, replanning at every step."""

    anyway: bool = False
    """Fly an unsafe plan without asking for a confirmation."""


@dataclass(frozen=True)
class Pause:
    """Hold the running job after the time step in progress."""


@dataclass(frozen=True)
class Resume:
    """Let a held job go on."""


@dataclass(frozen=True)
class StepOnce:
    """Let a held job take one time step."""


@dataclass(frozen=True)
class Gust:
    """Push the flying robot once."""


@dataclass(frozen=True)
class KidnapRobot:
    """Move the flying robot to another pose once, without a report to its filter."""


@dataclass(frozen=True)
class FindRobot:
    """Localize the robot globally by its last picture alone; a flight goes on from the pose that is found."""


@dataclass(frozen=True)
class FlightSettings:
    """Settings of flights: seed, noise, world and pace."""

    seed: int = 0
    """Seed of everything random."""
    position_noise_m: float = StateNoise.position_m
    """Standard deviation of the disturbance of each coordinate of the position at each time step [m]."""
    attitude_noise_rad: float = StateNoise.attitude_rad
    """The same of the attitude [rad]; velocity and body rate are disturbed by half as much in their units."""
    open_loop: bool = False
    """Fly the first plan without filter and replanning."""
    world: WorldName = "paper"
    """The paper's noise, or the physical world, whose disturbances are its own."""
    realtime: bool = False
    """Let the world go on while filter and planner compute."""
    pace: float = 1.0
    """Speed of a flight as a multiple of real time; 0: as fast as it is computed."""

    @property
    def noise(self) -> StateNoise:
        """Disturbance at each time step, of the rates by half as much (as in the paper)."""
        position, attitude = self.position_noise_m, self.attitude_noise_rad
        return StateNoise(position, 0.5 * position, attitude, 0.5 * attitude)


@dataclass(frozen=True)
class LocalizationRecord:
    """A global localization as far as it has come."""

    NEAR: ClassVar[int] = 4
    """Its result stays visible for so many time steps."""

    step: RelocaliseStep
    """The likeliest poses so far."""
    at: int
    """Time steps of the flight at that moment."""
    outcome: RelocaliseOutcome | None = None
    """None while the search goes on."""

    def is_visible_at(self, steps: int) -> bool:
        """True where a flight that shows so many time steps shows it too."""
        return abs(steps - self.at) <= self.NEAR


@dataclass(frozen=True)
class FlightRecord:
    """A flight as far as it has gone."""

    ends: Ends
    """Start and goal of the request."""
    steps: tuple[NavigationStep, ...] = ()
    """Time steps so far."""
    plan: Motion | None = None
    """The trajectory that the robot follows now."""
    guess: RigidState | None = None
    """Mean of the filter while it works on a picture; None between pictures."""
    doing: str = ""
    """Part of the time step in progress, for the user."""
    summary: dict[str, Any] = field(default_factory=dict)
    """Figures of the job, once it has finished."""
    goals_moved: tuple[int, ...] = ()
    """Time steps in which the goal was moved; not known of stored flights."""
    flown_by: Hashable = None
    """`Session.flown_by` when it began; None for stored flights, whose settings are not known."""
    flown_in: str = ""
    """`Session.field_made_by` when it began; empty for stored flights."""
    obstacles: ObstacleSet | None = None
    """Obstacles in the place at its last step; not known of stored flights."""

    @property
    def gusts(self) -> tuple[int, ...]:
        """Time steps in which a gust pushed the robot."""
        return tuple(index for index, step in enumerate(self.steps) if step.gust_mps)

    @property
    def outcome(self) -> EpisodeOutcome | None:
        """None while it flies, or when it was stopped."""
        return self.steps[-1].outcome if self.steps else None

    @property
    def leads_to_old_goal(self) -> bool:
        """True where the goal was moved after the last time step: its plan was made before."""
        return bool(self.goals_moved) and self.goals_moved[-1] >= len(self.steps)

    @property
    def times(self) -> tuple[float, ...]:
        """Of the steps [s]."""
        return tuple(index * self.tick for index in range(len(self.steps)))

    @property
    def tick(self) -> float:
        """Length of a step [s]."""
        return self.steps[0].plan.dt

    def cut(self, at: int) -> "FlightRecord":
        """Return the flight up to time step `at`."""
        return replace(self, steps=self.steps[: at + 1], plan=self.steps[at].plan, guess=None, doing="")

    def with_step(self, step: NavigationStep) -> "FlightRecord":
        """Add a time step."""
        return replace(self, steps=(*self.steps, step), plan=step.plan, guess=None, doing="")

    def with_iteration(self, step: PlanStep | FilterStep | RelocaliseStep) -> "FlightRecord":
        """Add an iteration of the planner, the filter or the search within a time step."""
        if isinstance(step, RelocaliseStep):
            return replace(self, doing="localizing the robot globally")
        if isinstance(step, FilterStep):
            return replace(self, guess=step.mean, doing="comparing its picture with the field")
        return replace(self, plan=step.motion, doing="replanning")


@dataclass(frozen=True, kw_only=True)
class FlightState:
    """The flight, or a camera track in its place, and the settings of the next flight: part of a Session."""

    flight_settings: FlightSettings = field(default_factory=FlightSettings)
    """Settings of the next flight."""
    flight: FlightRecord | None = None
    """The last flight."""
    track: TrackRecord | None = None
    """A camera track in place of a flight: there is at most one of both."""
    search: LocalizationRecord | None = None
    """The last global localization, as far as it has come."""

    @property
    def steps_reported(self) -> int:
        """Time steps of the flight so far, the start included."""
        return len(self.flight.steps) if self.flight is not None else 0
