"""The planner that a command line asks for, which decides what else can be said."""

from collections.abc import Sequence
from itertools import pairwise

from nerfnav.planner import PlannerEntry, planners

PLANNER = "fast"
"""Which planner is used where none is named."""


def planner_of(words: Sequence[str]) -> PlannerEntry:
    """The planner that the words of a command line ask for. Raises UnknownNameError, which lists the known ones."""
    planner = PLANNER
    for word, following in pairwise([*words, ""]):
        if word == "--planner" or word.startswith("--planner="):
            planner = word.partition("=")[2] or following
    return planners.load(planner)
