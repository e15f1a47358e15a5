"""Request of a flight: its route, estimator, seed and noise, and where its log goes."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from nerfnav.navigation import NavigateConfig, OperatorRequests, WorldName
from nerfnav.robots import Motion, RigidState
from nerfnav_app.jobs.plan.plan import PlanRequest


@dataclass(frozen=True)
class FlyRequest:
    """What to fly."""

    route: PlanRequest
    """From where to where, and how plans are made; its `out` is not used."""
    plan: Motion | None = None
    """The first plan where it is already made, from the route's start to its goal."""
    cautious: bool = False
    """Whether it stays on the ground where its own first plan is not to be flown: the page asks people then."""
    estimator: str = "fast"
    """Name of the estimator."""
    open_loop: bool = False
    """Fly the first plan blindly."""
    seed: int = 0
    """Seed of everything random: noise, first belief, choice of pixels."""
    world: WorldName = "paper"
    """The paper's noise, or the physical world, which has no use for the noise of `config`."""
    realtime: bool = False
    """Whether the world goes on while filter and planner compute."""
    config: NavigateConfig = field(default_factory=NavigateConfig)
    """How the flight is flown."""
    orders: Callable[[], OperatorRequests] = OperatorRequests
    """Asked at each time step for what has changed on the way."""
    source: str = ""
    """What was opened, for the record: scene name or field file; empty means the place's name."""
    task: str | None = None
    """The scene's task that is flown, for the record; None where the ends were chosen freely."""
    out: Path | None = None
    """Folder for the log, which grows with each step, then the episode and trajectory.csv, trajectory.json; None
    writes nothing."""


class GoalRecorder:
    """The orders of a flight, and the last goal that was among them."""

    def __init__(self, orders: Callable[[], OperatorRequests]) -> None:
        self._orders = orders
        self.goal: RigidState | None = None

    def __call__(self) -> OperatorRequests:
        orders = self._orders()
        self.goal = orders.goal or self.goal
        return orders
