"""What users choose by name; planners, robots and formats are in tables of the library."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeVar

from nerfnav import robots
from nerfnav.errors import UnknownNameError
from nerfnav.estimator.fast import FastFilter, inerf
from nerfnav.estimator.filter import PoseFilter
from nerfnav.planner import planners

ESTIMATORS = {"fast": FastFilter, "paper": PoseFilter, "inerf": inerf}
"""Name to what makes an estimator for a field, a robot and a camera."""

Named = TypeVar("Named")


def named(kind: str, name: str, known: Mapping[str, Named]) -> Named:
    """The entry called `name`; raises UnknownNameError that lists the known ones."""
    if name not in known:
        raise UnknownNameError(kind, name, known)
    return known[name]


@dataclass(frozen=True)
class Choice:
    """What moves, what plans and what estimates."""

    robot: str = "quadrotor"
    """One of `nerfnav.robots.names()`."""
    planner: str = "fast"
    """One of `nerfnav.planner.planners.names()`."""
    estimator: str = "fast"
    """One of ESTIMATORS."""

    def check(self) -> None:
        """Raise UnknownNameError, which lists what exists, for a name that nothing has."""
        robots.load(self.robot)
        planners.load(self.planner)
        named("estimator", self.estimator, ESTIMATORS)
