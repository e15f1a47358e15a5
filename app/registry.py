"""What users choose by name: `--planner`, `--estimator`."""

from collections.abc import Mapping
from typing import TypeVar

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
ESTIMATORS = {"fast": FastFilter, "paper": PoseFilter, "inerf": inerf}
"""Name to what makes an estimator for a field, a robot and a camera."""

Entry = TypeVar("Entry")


def named(kind: str, name: str, known: Mapping[str, Entry]) -> Entry:
    """The entry called `name`; raises UnknownNameError that lists the known ones."""
    if name not in known:
        raise UnknownNameError(kind, name, known)
    return known[name]
