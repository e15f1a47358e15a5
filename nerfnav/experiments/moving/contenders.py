"""Contenders of the experiment on moving obstacles: each flies one world, and says how long its plans took.

Times are CPU times of the one thread that plans: other processes do not change them.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from jaxtyping import Float

from nerfnav.core.registry import Registry
from nerfnav.experiments.moving.snapshot import PERIOD_S, RRTInSnapshot, Snapshot, SnapshotFlight, SnapshotPlanner
from nerfnav.experiments.moving.worlds import HALF_M, World
from nerfnav.experiments.planners import missing_planners
from nerfnav.experiments.rivals.flask_planner import ABOVE_M, BELOW_M, PACKAGE, WIDTH_M
from nerfnav.experiments.rivals.rival import explain_missing
from nerfnav.planner.moving.replanning import Replanner
from nerfnav.planner.moving.search import plan_among
from nerfnav.planner.moving.spline import Points, SplinePlan

_SCALE = WIDTH_M / (2 * HALF_M)
"""Enlargement of the world for the robot of drone-planning."""
_LIFT_M = 0.5 * (BELOW_M - ABOVE_M)
_POINTS_M = 0.2
"""Largest distance of points on the boxes' surfaces for planners of point clouds [m]: the robot's width."""


@dataclass(frozen=True)
class Flight:
    """Flight of a contender."""

    plan: SplinePlan | None
    """Its motion; None: it never set off."""
    first_ms: float
    """CPU time of its first plan [ms]."""
    replan_ms: tuple[float, ...] = ()
    """CPU times of its replans [ms]."""


@dataclass(frozen=True)
class Contender:
    """Planner in the comparison, with what a reader must know about it."""

    name: str
    """Name in the table."""
    fly: Callable[[World], Flight]
    """Function that flies through a world."""
    knows: str
    """Knowledge that it has of the obstacles."""
    missing: Callable[[], str | None] = field(default=lambda: None)
    """Reason why it cannot run here, and the remedy; None where it can."""


def fly_announced(world: World, replans: bool) -> Flight:
    """Fly with the motion of all obstacles known, with replanning at 10 Hz or by the first plan alone."""
    begun, problem = time.thread_time(), world.problem()
    if not replans:
        plan = plan_among(problem)
        return Flight(plan, 1e3 * (time.thread_time() - begun))
    replanner = Replanner(problem)
    first_ms, replan_ms = 1e3 * (time.thread_time() - begun), list[float]()
    while len(replan_ms) * PERIOD_S < replanner.plan.duration:
        begun = time.thread_time()
        replanner.update(len(replan_ms) * PERIOD_S)
        replan_ms.append(1e3 * (time.thread_time() - begun))
    return Flight(replanner.plan, first_ms, tuple(replan_ms))


def fly_in_snapshots(planner: SnapshotPlanner, world: World) -> Flight:
    """Fly with replanning at 10 Hz around the obstacles as they stand."""
    flight = SnapshotFlight(world.problem(), planner, world.seed)
    plan = flight.fly()
    return Flight(plan, flight.replan_ms[0], tuple(flight.replan_ms[1:]))


@dataclass(frozen=True)
class FlaskInSnapshot:
    """FLASK, the kinodynamic planner of drone-planning, on points of the boxes' surfaces (see rivals)."""

    time_limit_s: float = 60.0
    """Longest search, and longest simplification [s]: its limits of iterations end them, so that equal seeds give equal
    flights."""

    def find_path(
        self, snapshot: Snapshot, start: Float[np.ndarray, "3"], goal: Float[np.ndarray, "3"], seed: int
    ) -> Points | None:
        """Find a path from start to goal [m]; None where there is none in time."""
        from drone_planning.planning import create_planner  # pyright: ignore[reportMissingImports]
        from drone_planning.types import KinodynamicConfig, PlannerConfig  # pyright: ignore[reportMissingImports]

        names = ("base_x_joint", "base_y_joint", "base_z_joint")
        lower, upper = np.minimum(snapshot.lower, start), np.maximum(snapshot.upper, start)
        lift = np.array([0.0, 0.0, _LIFT_M])
        spans = np.stack([_SCALE * lower + lift, _SCALE * upper + lift], -1)
        limits = {name: (float(low), float(high)) for name, (low, high) in zip(names, spans, strict=True)}
        cloud = (_SCALE * _surface_points(snapshot)).astype(np.float32)
        planner: Any = create_planner("x500_base", PlannerConfig(joint_limits=limits), pointcloud=cloud)
        config = KinodynamicConfig(
            time_limit=self.time_limit_s, simplify_time_limit=self.time_limit_s, seed=1 + seed
        )
        ends = (np.array([*(_SCALE * end + lift), 0.0]) for end in (start, goal))
        result = planner.plan_kinodynamic(*ends, config=config)
        if result.trajectory is None:
            return None
        poses = result.trajectory.sample(np.linspace(0.0, result.trajectory.duration, 60))[0]
        return (poses[:, :3] - lift) / _SCALE


def _surface_points(snapshot: Snapshot) -> Points:
    """Points on the surfaces of the true boxes [m]: a snapshot's are enlarged by the robot."""
    found = [np.zeros((0, 3))]
    for middle, half in zip(snapshot.middles, snapshot.halves - HALF_M, strict=True):
        counts = np.ceil(2 * half / _POINTS_M).astype(int) + 1
        axes = [np.linspace(-edge, edge, count) for edge, count in zip(half, counts, strict=True)]
        grid = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
        found.append(middle + grid[(np.abs(np.abs(grid) - half) < 1e-9).any(1)])
    return np.concatenate(found)


CONTENDERS: Registry[Contender] = Registry("planner", (
    Contender("announced", partial(fly_announced, replans=True), "the motion of all obstacles"),
    Contender("announced_once", partial(fly_announced, replans=False), "the motion of all obstacles; no replanning"),
    Contender(
        "rrt",
        partial(fly_in_snapshots, RRTInSnapshot()),
        "all boxes as they stand; OMPL's RRT with 10,000 checks at most, its path flown at 3 m/s",
        lambda: missing_planners().get("rrt"),
    ),
    Contender(
        PACKAGE,
        partial(fly_in_snapshots, FlaskInSnapshot()),
        f"all boxes as they stand, as points; FLASK with its defaults in a world enlarged {_SCALE:.3g} times, its path "
        "flown at 3 m/s",
        partial(explain_missing, PACKAGE, "drone_planning.planning", f"pip install {PACKAGE} (it states no licence)"),
    ),
))  # fmt: skip
"""Contenders by name, in the order of the table."""
