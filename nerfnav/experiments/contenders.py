"""Contenders of the comparison of planners, with what they know of the field."""

from functools import lru_cache

from nerfnav.errors import MissingExtraError
from nerfnav.experiments.arena import Arena
from nerfnav.experiments.study import Row
from nerfnav.planner import OccupancyMap, Planner, RRTConfig, planners
from nerfnav.planner.clearance import BallCheck
from nerfnav.planner.rrt import ball_check, require_ompl
from nerfnav.robots import Quadrotor

ROBOT = Quadrotor()
"""What all of them plan for."""


def missing() -> Row:
    """Planners whose library is not installed, and what to do about it."""
    try:
        require_ompl()
    except MissingExtraError as error:
        return {"rrt": str(error)}
    return {}


def contender_for(arena: Arena, name: str, seed: int) -> Planner:
    """The planner of that name, with its maps made before; `seed` is of what is random in it."""
    occupancy, check = _maps(arena)
    if name == "rrt":
        tree = RRTConfig(seed=seed)
        return planners.load("rrt").make(arena.field, ROBOT, tree, occupancy=occupancy, check=check)
    known_as = {"nerfnav": "fast"}.get(name, name)
    return planners.load(known_as).make(arena.field, ROBOT, occupancy=occupancy)


@lru_cache(maxsize=2)
def _maps(arena: Arena) -> tuple[OccupancyMap, BallCheck]:
    """What planners know of the field, made once."""
    occupancy = OccupancyMap.of(arena.field, ROBOT.body)
    return occupancy, ball_check(arena.field, ROBOT, RRTConfig())
