"""Request of a flight: its route, estimator, seed and noise, and where its log goes."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from nerfnav.navigation import OperatorRequests
from nerfnav.robots import Motion, RigidState
from nerfnav_app.jobs.plan.plan import PlanRequest


@dataclass(frozen=True)
class FlyRequest:
    """Request of the fly job."""

    route: PlanRequest
    """Request of its first plan: ends, settings, configuration and world; its `out` is not used."""
    plan: Motion | None = None
    """That plan, where it is already made."""
    cautious: bool = False
    """Whether the robot stays on the ground where its first plan is not to be flown: the page asks the user then."""
    estimator: str = "fast"
    """Name of the estimator."""
    open_loop: bool = False
    """Fly the first plan blindly."""
    seed: int = 0
    """Seed of everything random: noise, first belief, choice of pixels."""
    realtime: bool = False
    """Whether the world goes on while filter and planner compute."""
    operator: Callable[[], OperatorRequests] = OperatorRequests
    """Called once before each time step."""
    source: str = ""
    """Scene name or field file that was opened, for the record; empty: the place's name."""
    task: str | None = None
    """The scene's task that is flown, for the record; None where the ends were chosen freely."""
    out: Path | None = None
    """Folder for the log, which grows with each step, then the episode and trajectory.csv, trajectory.json; None
    writes nothing."""


class GoalRecorder:
    """Operator of a flight that records the last goal among its requests."""

    def __init__(self, operator: Callable[[], OperatorRequests]) -> None:
        self._operator = operator
        self.goal: RigidState | None = None

    def __call__(self) -> OperatorRequests:
        requests = self._operator()
        self.goal = requests.goal or self.goal
        return requests
