"""What users choose by name: robot, planner, estimator."""

from dataclasses import dataclass

from app.registry import ESTIMATORS, PLANNERS, named
from nerfnav import robots


@dataclass(frozen=True)
class Choice:
    """What moves, what plans and what estimates."""

    robot: str = "quadrotor"
    """One of `nerfnav.robots.names()`."""
    planner: str = "fast"
    """One of `app.registry.PLANNERS`."""
    estimator: str = "fast"
    """One of `app.registry.ESTIMATORS`."""

    def check(self) -> None:
        """Raise UnknownNameError, which lists what exists, for a name that nothing has."""
        robots.load(self.robot)
        named("planner", self.planner, PLANNERS)
        named("estimator", self.estimator, ESTIMATORS)
