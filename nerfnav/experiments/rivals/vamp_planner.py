"""VAMP: the vectorised RRT-Connect of a ball, on points of the surface.

The world is enlarged until the ball around the body is as large as VAMP's own, so that its settings mean the same.
Times are those of its own clock: a call from Python copies all points each time, for seconds.

Thomason, Kingston and Kavraki, "Motions in microseconds via vectorized sampling-based planning", ICRA 2024. Its package
comes as source only: it is no dependency, and is imported only where a person has installed it.
"""

from functools import partial
from typing import Any

import numpy as np

from nerfnav.core.extras import installed_version
from nerfnav.experiments.arena import Arena
from nerfnav.experiments.planners import ROBOT
from nerfnav.experiments.rivals.rival import (
    POINTS_M,
    Answer,
    Plan,
    Rival,
    explain_missing,
    make_search_mesh,
    sample_surface,
)
from nerfnav.planner import PlanProblem
from nerfnav.planner.baselines.rrt import BallCheck, room_near

PACKAGE = "vamp-planner"
RADIUS_M, _POINT_M = 0.2, 0.0025
"""VAMP's own radius of the ball and of points [m]."""
SCALE = RADIUS_M / ROBOT.body.radius
"""Enlargement of the world."""


def _prepare(arena: Arena) -> Plan:
    import vamp  # pyright: ignore[reportMissingImports]

    environment = vamp.Environment()
    environment.add_pointcloud((SCALE * sample_surface(arena)).tolist(), RADIUS_M, RADIUS_M, _POINT_M)
    check = BallCheck(make_search_mesh(arena), ROBOT.body.radius)
    return partial(_plan, vamp, environment, check, arena)


def _plan(vamp: Any, environment: Any, check: BallCheck, arena: Arena, problem: PlanProblem, seed: int) -> Answer:
    ends = [state.position for state in (problem.start, problem.goal)]
    with_room = [room_near(check, arena.field.box, end) for end in ends]  # as for the planner rrt
    if with_room[0] is None or with_room[1] is None:
        return Answer(0.0, reason="no room for the ball near an end")
    first, last = (SCALE * end for end in with_room if end is not None)
    ball, _, settings, simplify = vamp.configure_robot_and_planner_with_kwargs("sphere", "rrtc")
    lower, upper = (SCALE * edge.double().numpy() for edge in (arena.field.box.lower, arena.field.box.upper))
    ball.set_radius(RADIUS_M)  # settings of the whole process, and of another place before
    ball.set_lows((lower + RADIUS_M).tolist())
    ball.set_highs((upper - RADIUS_M).tolist())
    samples = ball.halton()
    samples.skip(seed)
    found = ball.rrtc(first, last, environment, settings, samples)
    if not found.solved:
        return Answer(1e-6 * found.nanoseconds, reason="no path within its iterations")
    shortened = ball.simplify(found.path, environment, simplify, samples)
    path, ms = shortened.path.numpy(), 1e-6 * (found.nanoseconds + shortened.nanoseconds)
    return Answer(ms, np.concatenate([[ends[0].numpy()], path.astype(np.float64) / SCALE, [ends[1].numpy()]]))


VAMP = Rival(
    PACKAGE,
    _prepare,
    partial(explain_missing, PACKAGE, "vamp", f"pip install {PACKAGE} (from source: a compiler, Eigen and the net)"),
    lambda: str(installed_version(PACKAGE)),
    options=(
        "RRT-Connect and simplification of the ball around the body with its defaults, on points at most "
        f"{1e3 * POINTS_M:g} mm apart; the world enlarged {SCALE:.3g} times; times by its own clock"
    ),
    omits=(
        "no attitude, dynamics or times: a ball's path, flown along its smoothed form; no cost of collisions, no "
        "field; its tree of points takes some balls that touch for free"
    ),
)
