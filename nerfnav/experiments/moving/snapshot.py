"""Planners without motion: a path around the boxes as they stand now, replanned at 10 Hz, and flown within the limits.

At each step the path leads from the newest control point to a place ahead on the line to the goal. The next control
point follows it, as fast and as sharply as the limits of motion allow.
"""

import time
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float

from nerfnav.core.extras import import_extra
from nerfnav.planner.moving.problem import MovingConfig, MovingProblem, Steps
from nerfnav.planner.moving.spline import Points, SplinePlan
from nerfnav.planner.moving.timetable import Timetable

PERIOD_S = 0.1
"""Time between replans [s]."""
HORIZON_M = 15.0
"""Distance ahead at which a path ends [m], as in SANDO."""
LONGEST_S = 100.0
"""Longest flight [s]."""
_MARGIN_M = 0.1
"""Distance from boxes that a path keeps, beyond the robot [m]."""
_LOOK_S = 0.25
"""Distance along the path of the point that is followed, as time at the present speed [s]."""
_ARRIVED_M, _AT_REST_M = 0.2, 0.005
"""Distance from the goal, and difference of control points, below which a flight is over [m]."""
_GOALS = 60
"""Places around the end of the horizon that are tried, where a box covers it."""


@dataclass(frozen=True)
class Snapshot:
    """Boxes as they stand, enlarged by the robot and a margin, and the region that a path may lead through."""

    middles: Float[np.ndarray, "k 3"]
    """[m]"""
    halves: Float[np.ndarray, "k 3"]
    """[m]"""
    lower: Float[np.ndarray, "3"]
    """Smallest coordinates of the robot's centre [m]."""
    upper: Float[np.ndarray, "3"]
    """Largest coordinates of the robot's centre [m]."""

    def is_free(self, point: Float[np.ndarray, "3"]) -> bool:
        """Check that a place is in no box."""
        return not (np.abs(point - self.middles) <= self.halves).all(-1).any()


@runtime_checkable
class SnapshotPlanner(Protocol):
    """Planner of a path in a snapshot."""

    def find_path(
        self, snapshot: Snapshot, start: Float[np.ndarray, "3"], goal: Float[np.ndarray, "3"], seed: int
    ) -> Points | None:
        """Find a path from start to goal [m]; None where there is none in time."""
        ...


@dataclass(frozen=True)
class RRTInSnapshot:
    """OMPL's RRT, its path shortened by OMPL (LaValle, "Rapidly-exploring random trees", 1998).

    Limits of checks end a search, not of time, so that equal seeds give equal flights.
    """

    most_checks: int = 10000
    """Places that are checked at most until a path is found: some 80 ms, less than a period."""
    shortcuts: int = 200
    """Shortcuts of the path that are tried."""
    reach_m: float = 2.0
    """Longest branch [m]."""
    resolution_m: float = 0.1
    """Distance of the places at which a branch is checked [m]."""

    def find_path(
        self, snapshot: Snapshot, start: Float[np.ndarray, "3"], goal: Float[np.ndarray, "3"], seed: int
    ) -> Points | None:
        """Find a path from start to goal [m]; None where there is none in time."""
        base, geometric, util = (
            import_extra(f"ompl.{part}", "baselines", "the planner rrt") for part in ("base", "geometric", "util")
        )
        util.setLogLevel(util.LOG_NONE)
        util.RNG.setSeed(1 + seed)
        space, bounds = base.RealVectorStateSpace(3), base.RealVectorBounds(3)
        for axis in range(3):
            bounds.setLow(axis, float(min(snapshot.lower[axis], start[axis])))
            bounds.setHigh(axis, float(max(snapshot.upper[axis], start[axis])))
        space.setBounds(bounds)
        setup, checks = geometric.SimpleSetup(space), [0]

        def is_valid(state: Any) -> bool:
            checks[0] += 1
            return snapshot.is_free(np.array([state[0], state[1], state[2]]))

        setup.setStateValidityChecker(is_valid)
        setup.getSpaceInformation().setStateValidityCheckingResolution(self.resolution_m / space.getMaximumExtent())
        states = [_state_at(space, end) for end in (start, goal)]
        setup.setStartAndGoalStates(*states, 0.1)
        planner = geometric.RRT(setup.getSpaceInformation())
        planner.setRange(self.reach_m)
        setup.setPlanner(planner)
        setup.solve(base.PlannerTerminationCondition(lambda: checks[0] > self.most_checks))
        if not setup.haveExactSolutionPath():
            return None
        path = setup.getSolutionPath()
        geometric.PathSimplifier(setup.getSpaceInformation()).partialShortcutPath(path, self.shortcuts)
        return np.array([[state[axis] for axis in range(3)] for state in path.getStates()])


def _state_at(space: Any, place: Float[np.ndarray, "3"]) -> Any:
    state = space.allocState()
    for axis in range(3):
        state[axis] = float(place[axis])
    return state


@dataclass
class SnapshotFlight:
    """Flight by paths in snapshots."""

    problem: MovingProblem
    """World, whose motion the planner does not know."""
    planner: SnapshotPlanner
    """Planner of paths."""
    seed: int
    """Of what is random in it."""
    speed: float = 3.0
    """Speed along a path [m/s]."""
    replan_ms: list[float] = field(default_factory=list)
    """CPU time of each replan [ms]."""

    def fly(self) -> SplinePlan:
        """Fly until the goal, a touch, or LONGEST_S; return the motion."""
        problem, config = self.problem, MovingConfig(layer_s=PERIOD_S, parts=2)
        table, steps = Timetable(problem, config), Steps.of(problem.limits, PERIOD_S)
        goal, points = np.array(problem.goal), [np.array(problem.start)] * 3
        while len(points) * PERIOD_S < LONGEST_S:
            knot = len(points) - 3
            middles = table.centers(2 * knot + 1)[2 * knot]
            begun = time.thread_time()
            path = self._path(middles, table.halves, points[-1], goal)
            self.replan_ms.append(1e3 * (time.thread_time() - begun))
            points.append(points[-1] + self._step(points, path, steps))
            near = np.linalg.norm(np.array(points[-3:]) - goal, axis=1).max() < _ARRIVED_M
            near &= np.abs(np.diff(points[-3:], axis=0)).max() < _AT_REST_M
            place = (points[-3] + 4 * points[-2] + points[-1]) / 6
            if near or _touches(place, table.centers(2 * knot + 3)[-1], table.halves).any():
                break
        return SplinePlan(np.array(points), PERIOD_S, problem.axes)

    def _path(
        self,
        middles: Float[np.ndarray, "k 3"],
        halves: Float[np.ndarray, "k 3"],
        start: Float[np.ndarray, "3"],
        goal: Float[np.ndarray, "3"],
    ) -> Points | None:
        """Path from the newest control point to the end of the horizon."""
        lower, upper = (np.array(side, float) for side in (self.problem.lower, self.problem.upper))
        lower[0], upper[0] = start[0] - 1.0, min(start[0] + HORIZON_M + 2.0, goal[0] + 1.0)
        wide = halves + _MARGIN_M
        inside = (np.abs(middles[:, 0] - start[0]) <= HORIZON_M + 5.0) & ~_touches(start, middles, wide)
        snapshot = Snapshot(middles[inside], wide[inside], lower, upper)
        way = goal - start
        target = start + way * min(1.0, HORIZON_M / max(1e-9, float(np.linalg.norm(way))))
        random = np.random.default_rng(self.seed)
        for attempt in range(_GOALS):
            place = (target + attempt * 0.05 * random.normal(size=3)).clip(lower, upper) if attempt else target
            if snapshot.is_free(place):
                return self.planner.find_path(snapshot, start, place, self.seed)
        return None

    def _step(self, points: list[np.ndarray], path: Points | None, steps: Steps) -> Float[np.ndarray, "3"]:
        """Difference to the next control point: towards the path, or to rest without one."""
        last = points[-1] - points[-2]
        wanted = np.zeros(3)
        if path is not None:
            goal = np.array(self.problem.goal)
            left = float(np.linalg.norm(goal - points[-1]))
            braking = float(np.sqrt(steps.gain / PERIOD_S**2 * left))  # half of the largest deceleration
            speed = min(self.speed, braking)
            to = _point_along(path, max(0.2, _LOOK_S * float(np.linalg.norm(last)) / PERIOD_S)) - points[-1]
            wanted = to / max(float(np.linalg.norm(to)), speed * PERIOD_S, 1e-9) * speed * PERIOD_S
        return (last + (wanted - last).clip(-steps.gain, steps.gain)).clip(-steps.ahead, steps.ahead)


def _touches(
    point: Float[np.ndarray, "3"], middles: Float[np.ndarray, "k 3"], halves: Float[np.ndarray, "k 3"]
) -> Bool[np.ndarray, " k"]:
    return np.all(np.abs(point - middles) <= halves, axis=-1)


def _point_along(path: Points, length: float) -> Float[np.ndarray, "3"]:
    """Point of a path at a length from its start [m], at most its end."""
    at = np.concatenate([[0.0], np.linalg.norm(np.diff(path, axis=0), axis=1).cumsum()])
    return np.array([np.interp(length, at, axis) for axis in path.T])
