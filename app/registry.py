"""What users choose by name: `--planner`, `--estimator`."""

from collections.abc import Mapping
from typing import TypeVar

from nerfnav.errors import UnknownNameError
from nerfnav.estimator.filter import PoseFilter
from nerfnav.navigation.planners import PaperPlanner

PLANNERS = {"paper": PaperPlanner}
"""Name to what makes a planner for a field and a robot."""
ESTIMATORS = {"paper": PoseFilter}
"""Name to what makes an estimator for a field, a robot and a camera."""

Entry = TypeVar("Entry")


def named(kind: str, name: str, known: Mapping[str, Entry]) -> Entry:
    """The entry called `name`; raises UnknownNameError that lists the known ones."""
    if name not in known:
        raise UnknownNameError(kind, name, known)
    return known[name]
