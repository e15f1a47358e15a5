"""Request of a plan: from where to where, by which planner, with what bounds; validated when it is made."""

from dataclasses import dataclass, replace
from pathlib import Path

from app.jobs.validation import require_positive, require_probability
from app.places.ends import Ends
from nerfnav.errors import InvalidInputError
from nerfnav.field import Unknown
from nerfnav.planner import PlannerConfig, planners


@dataclass(frozen=True)
class PlanRequest:
    """What to plan."""

    ends: Ends
    """Where the robot is, and where it shall come to rest."""
    steps: int = 20
    """Number of time steps."""
    dt: float = 0.1
    """Length of a step [s]."""
    planner: str = "fast"
    """Name of the planner."""
    config: PlannerConfig | None = None
    """Its settings; None: its own."""
    again: PlannerConfig | None = None
    """Its settings when the plan is redone at each step of a flight; None: the above with room for what pushes it."""
    keep_dt: bool = False
    """Whether steps have just this length where a duration is found, however many they are."""
    shortest: bool = False
    """Whether to find the shortest duration that keeps the robot's limits, in place of `steps`."""
    max_collision: float | None = None
    """Largest bound on the probability of a collision that is accepted; None accepts any."""
    unknown: Unknown = Unknown.OCCUPIED
    """What space that no camera ever saw into is taken for."""
    out: Path | None = None
    """Folder for trajectory.csv, trajectory.json and plan.json; None writes nothing."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for numbers that no plan can have."""
        require_positive(steps=self.steps, dt=self.dt, iterations=self.settings.iterations)
        require_probability(max_collision=self.max_collision)

    @property
    def settings(self) -> PlannerConfig:
        """How the planner works. Raises NerfnavError for an unknown planner, or settings of another one."""
        own = planners.load(self.planner).config()
        for given in (self.config, self.again):
            if given is not None and type(given) is not type(own):
                raise InvalidInputError(f"these settings are not those of the planner {self.planner!r}: leave them out")
        return own if self.config is None else self.config

    def lasting(self, seconds: float) -> "PlanRequest":
        """The same in a given time [s], cut into whole steps of about dt. Raises InvalidInputError for none."""
        require_positive(duration=seconds)
        steps = max(1, round(seconds / self.dt))
        return replace(self, steps=steps, dt=seconds / steps)
