"""What users choose by name: robot, planner, estimator."""

from dataclasses import dataclass

from app.registry import ESTIMATORS, named
from nerfnav import robots
from nerfnav.planner import planners


@dataclass(frozen=True)
class Choice:
    """What moves, what plans and what estimates."""

    robot: str = "quadrotor"
    """One of `nerfnav.robots.names()`."""
    planner: str = "fast"
    """One of `nerfnav.planner.planners.names()`."""
    estimator: str = "fast"
    """One of `app.registry.ESTIMATORS`."""

    def check(self) -> None:
        """Raise UnknownNameError, which lists what exists, for a name that nothing has."""
        robots.load(self.robot)
        planners.load(self.planner)
        named("estimator", self.estimator, ESTIMATORS)
