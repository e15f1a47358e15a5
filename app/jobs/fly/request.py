"""Request of a flight: its route, estimator, seed and noise, and where its log goes."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import torch

from nerfnav.navigation import OperatorRequests
from nerfnav.planner import PlanOutcome
from nerfnav.robots import Motion, RigidState
from nerfnav_app.jobs.plan.plan import PlanRequest
from nerfnav_app.places.place import Place


@dataclass(frozen=True)
class FlyRequest:
    """Request of the fly job."""

    route: PlanRequest
    """Request of its first plan: ends, settings, configuration and world; its `out` is not used."""
    plan: Motion | None = None
    """That plan, where it is already made."""
    plan_outcome: PlanOutcome | None = None
    """Outcome of that plan, for the record."""
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
    surroundings: Callable[[], Place] | None = None
    """Called before each time step: the place with its obstacles as they stand now; None: they stay."""
    source: str = ""
    """Scene name or field file that was opened, for the record; empty: the place's name."""
    task: str | None = None
    """The scene's task that is flown, for the record; None where the ends were chosen freely."""
    camera: Path | None = None
    """Calibration of the robot's camera that was given, for the record."""
    obstacles: Path | None = None
    """File of the obstacles that were placed, for the record."""
    out: Path | None = None
    """Folder for the log, which grows with each step, then the episode and trajectory.csv, trajectory.json; None
    writes nothing."""


class OperatorRecorder:
    """Operator of a flight that records its requests."""

    def __init__(self, operator: Callable[[], OperatorRequests], goal: RigidState) -> None:
        """Record the requests of `operator` on a flight to `goal`."""
        self._operator, self._first_goal = operator, goal
        self.goal: RigidState | None = None
        self.made: tuple[str, ...] = ()
        """Kinds of requests so far, in words."""

    def __call__(self) -> OperatorRequests:
        """Take the requests for the next time step."""
        requests = self._operator()
        self.goal = requests.goal or self.goal
        kinds = {
            "another goal": requests.goal is not None and not self._is_first(requests.goal),
            "a gust": requests.gust is not None,
            "a kidnapping": requests.kidnap_pose is not None,
            "a search": requests.search,
            "other obstacles": requests.stack is not None,
        }
        self.made += tuple(kind for kind, asked in kinds.items() if asked and kind not in self.made)
        return requests

    def _is_first(self, goal: RigidState) -> bool:
        first = self._first_goal
        return torch.equal(goal.position, first.position) and torch.equal(goal.rotation, first.rotation)
