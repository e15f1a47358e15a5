"""What users choose by name, out of the library's tables."""

from dataclasses import dataclass

from nerfnav import robots
from nerfnav.estimator import estimators
from nerfnav.planner import planners


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
        """Raise UnknownNameError, which lists what exists, for a name that nothing has."""
        robots.load(self.robot)
        planners.load(self.planner)
        estimators.load(self.estimator)
