"""The planners, one file for each: the one table that every choice of a planner reads."""

from nerfnav.core.registry import Registry
from nerfnav.planner.planners.fast import FAST
from nerfnav.planner.planners.minsnap import MINSNAP
from nerfnav.planner.planners.paper import PAPER
from nerfnav.planner.planners.planner import PlannerEntry
from nerfnav.planner.planners.rrt import RRT

PLANNERS: Registry[PlannerEntry] = Registry("planner", (FAST, MINSNAP, RRT, PAPER))
"""Name to planner, the quick ones first."""


def names() -> tuple[str, ...]:
    """What `load` knows."""
    return tuple(PLANNERS)


def load(name: str) -> PlannerEntry:
    """The planner of that name; raises UnknownNameError that lists the known ones."""
    return PLANNERS[name]


def register(entry: PlannerEntry) -> None:
    """Make a planner known by its name. Raises NameTakenError where another one has it."""
    PLANNERS.register(entry)
