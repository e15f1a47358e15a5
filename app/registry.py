"""What users choose by name: robot, planner, estimator."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeVar

from nerfnav import robots
from nerfnav.errors import UnknownNameError
from nerfnav.estimator.fast import FastFilter, inerf
from nerfnav.estimator.filter import PoseFilter
from nerfnav.navigation.baselines import MinSnapPlanner, RRTPlanner
from nerfnav.navigation.planners import FastPlanner, PaperPlanner
from nerfnav.planner.fast import FastPlanConfig
from nerfnav.planner.minsnap import MinSnapConfig
from nerfnav.planner.optimize import PlanConfig
from nerfnav.planner.rrt import RRTConfig

PLANNERS = {"paper": PaperPlanner, "fast": FastPlanner, "minsnap": MinSnapPlanner, "rrt": RRTPlanner}
"""Name to what makes a planner for a field and a robot."""
PLAN_CONFIGS = {"paper": PlanConfig.paper, "fast": FastPlanConfig, "minsnap": MinSnapConfig, "rrt": RRTConfig}
"""Name of a planner to what makes its settings."""
REAL_TIME = ("fast",)
"""Planners that are quick enough to plan again while the hand still holds an end."""
ESTIMATORS = {"fast": FastFilter, "paper": PoseFilter, "inerf": inerf}
"""Name to what makes an estimator for a field, a robot and a camera."""

PlannerConfig = PlanConfig | FastPlanConfig | MinSnapConfig | RRTConfig
"""The settings of a planner."""

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
    """One of PLANNERS."""
    estimator: str = "fast"
    """One of ESTIMATORS."""

    def check(self) -> None:
        """Raise UnknownNameError, which lists what exists, for a name that nothing has."""
        robots.load(self.robot)
        named("planner", self.planner, PLANNERS)
        named("estimator", self.estimator, ESTIMATORS)
