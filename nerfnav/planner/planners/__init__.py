"""Registry of planners, one file for each: every choice of a planner reads this table."""

from nerfnav.core.registry import Registry
from nerfnav.planner.planners.fast import FAST
from nerfnav.planner.planners.minsnap import MINSNAP
from nerfnav.planner.planners.paper import PAPER
from nerfnav.planner.planners.planner import PlannerEntry
from nerfnav.planner.planners.rrt import RRT

PLANNERS: Registry[PlannerEntry] = Registry("planner", (FAST, MINSNAP, RRT, PAPER))
"""Planners by name, the quick ones first."""


def names() -> tuple[str, ...]:
    """List the names that `load` knows."""
    return tuple(PLANNERS)


def load(name: str) -> PlannerEntry:
    """Return the planner of a name. Raises UnknownNameError, which lists the known ones."""
    return PLANNERS[name]


def register(entry: PlannerEntry) -> None:
    """Add a planner. Raises NameTakenError where another one has its name."""
    PLANNERS.register(entry)
