"""Own planners: nerfnav's fast planner, and the paper's baselines minimum snap and RRT."""

import time
from functools import partial
from importlib.metadata import version

from nerfnav import __version__
from nerfnav.core.errors import NerfnavError
from nerfnav.core.steps import run_steps
from nerfnav.experiments.arena import Arena
from nerfnav.experiments.planners import NO_PLAN, make_contender, missing_planners
from nerfnav.experiments.rivals.rival import Answer, Plan, Rival, make_planning_arena
from nerfnav.planner import PlanProblem


def _prepare(name: str, arena: Arena) -> Plan:
    planning = make_planning_arena(arena)
    make_contender(planning, name, 1)  # its maps
    return partial(_plan, name, planning)


def _plan(name: str, arena: Arena, problem: PlanProblem, seed: int) -> Answer:
    planner = make_contender(arena, name, seed)
    begun = time.perf_counter()
    try:
        result = run_steps(planner.plan(problem.route))
    except NerfnavError as error:  # an end that it does not plan between
        return Answer(1e3 * (time.perf_counter() - begun), reason=str(error))
    ms = 1e3 * (time.perf_counter() - begun)
    if result.outcome in NO_PLAN:
        return Answer(ms, reason=result.outcome.name.lower())
    return Answer(ms, result.motion.states.position.numpy(), result.motion)


def _nothing_missing() -> None:
    return None


NERFNAV = Rival(
    "nerfnav",
    partial(_prepare, "nerfnav"),
    _nothing_missing,
    lambda: __version__,
    options="the planner fast with its defaults, in the field",
    omits="the duration is given, not chosen; the optimum is a local one",
)
MINIMUM_SNAP = Rival(
    "minsnap",
    partial(_prepare, "minsnap"),
    _nothing_missing,
    lambda: __version__,
    options="A* on the occupancy map of the field, times of the corners optimised",
    omits="obstacles count at its corners only, not on the curve between; no cost of collisions",
)
RRT = Rival(
    "rrt",
    partial(_prepare, "rrt"),
    lambda: missing_planners().get("rrt"),
    lambda: f"ompl {version('ompl')}",
    options="OMPL's RRT of the ball around the body on the field's mesh, 5 s at most; a controller flies along",
    omits="no attitude, dynamics, times or cost in the search: a ball's path, another one with each seed",
)
