"""FLASK: the kinodynamic RRT-Connect of drone-planning, for one robot, on points of the surface.

Its robot is the Holybro X500: 126 spheres that stay level. The world is enlarged until they are as wide as the body
that is planned for. Times are enlarged by the square root of that, so that its limits of acceleration mean the same
(Froude's similarity), which its plans do not show: they are stretched to the duration of the problem.

Duong et al., "Ultrafast sampling-based kinodynamic planning via differential flatness", T-RO 2026. The package states
no licence: it is no dependency, and is imported only where a person has installed it.
"""

import math
import time
from functools import partial
from typing import Any

import numpy as np
import torch

from nerfnav.core.extras import installed_version
from nerfnav.experiments.arena import Arena
from nerfnav.experiments.planners import ROBOT
from nerfnav.experiments.rivals.rival import POINTS_M, Answer, Plan, Rival, explain_missing, sample_surface
from nerfnav.geometry import so3
from nerfnav.planner import PlanProblem
from nerfnav.robots import RigidState

PACKAGE = "drone-planning"
WIDTH_M, BELOW_M, ABOVE_M = 0.708, 0.289, 0.109
"""Width of the X500's spheres, and how far they reach below and above its frame [m]."""
SCALE = WIDTH_M / ROBOT.config.extents[0]
"""Enlargement of the world."""
_LIFT_M = 0.5 * (BELOW_M - ABOVE_M)
"""Height of its frame above the middle of its spheres [m]."""
_TIME_LIMIT_S = 60.0
"""Limits of iterations end a plan, not of time, so that equal seeds give equal plans."""


def _prepare(arena: Arena) -> Plan:
    from drone_planning.planning import create_planner  # pyright: ignore[reportMissingImports]
    from drone_planning.types import PlannerConfig  # pyright: ignore[reportMissingImports]

    lower, upper = (SCALE * edge.double().numpy() for edge in (arena.field.box.lower, arena.field.box.upper))
    beyond = np.array([[0.5 * WIDTH_M, 0.5 * WIDTH_M, BELOW_M], [0.5 * WIDTH_M, 0.5 * WIDTH_M, ABOVE_M]])
    limits = np.stack([lower + beyond[0], upper - beyond[1]], -1)
    names = ("base_x_joint", "base_y_joint", "base_z_joint")
    config = PlannerConfig(joint_limits={name: tuple(limit) for name, limit in zip(names, limits, strict=True)})
    return partial(_plan, create_planner("x500_base", config, pointcloud=SCALE * sample_surface(arena)))


def _plan(planner: Any, problem: PlanProblem, seed: int) -> Answer:
    from drone_planning.types import KinodynamicConfig  # pyright: ignore[reportMissingImports]

    config = KinodynamicConfig(time_limit=_TIME_LIMIT_S, simplify_time_limit=_TIME_LIMIT_S, seed=seed)
    begun = time.perf_counter()
    result = planner.plan_kinodynamic(_pose(problem.start), _pose(problem.goal), config=config)
    ms = 1e3 * (time.perf_counter() - begun)
    if result.trajectory is None:
        return Answer(ms, reason=result.status.value)
    times = result.trajectory.duration * np.arange(problem.steps + 1) / problem.steps
    poses = result.trajectory.sample(times)[0]
    waypoints = np.concatenate([(poses[:, :3] - [0, 0, _LIFT_M]) / SCALE, poses[:, 3:]], -1)
    trajectory = problem.trajectory_through(torch.from_numpy(waypoints).to(problem.start.position))
    return Answer(ms, waypoints[:, :3], trajectory.motion(problem.robot))


def _pose(state: RigidState) -> np.ndarray:
    """Position of its frame in the enlarged world [m], and yaw [rad]."""
    yaw = math.remainder(so3.yaw_of(state.rotation).item(), math.tau)
    return np.array([*(SCALE * state.position.double().numpy() + [0, 0, _LIFT_M]), yaw])


FLASK = Rival(
    PACKAGE,
    _prepare,
    partial(explain_missing, PACKAGE, "drone_planning.planning", f"pip install {PACKAGE} (it states no licence)"),
    lambda: str(installed_version(PACKAGE)),
    options=(
        f"FLASK for x500_base with its defaults but for time limits, on points at most {1e3 * POINTS_M:g} mm apart; "
        f"the world enlarged {SCALE:.3g} times; plans stretched to the duration of the flight"
    ),
    omits=(
        "one robot of 126 level spheres, no other body, no attitude; no cost of collisions, no field, no uncertainty; "
        "its tree of points takes some spheres that touch for free"
    ),
)
