"""Search among moving obstacles: x is given as a function of time, and y and z are searched in layers of time.

A cheapest path through cells of y and z in each layer gives the control points of a spline. Its steps are so small that
no limit of motion is exceeded, whatever their order. Then its third differences are lowered as far as obstacles allow
(Gauss-Seidel), and the spline is checked against all boxes. Slower speeds are tried where the fastest finds no way, and
then waiting.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from nerfnav.planner.kernels.moving import cheapest_layers, list_near, mark_layers, smooth_points
from nerfnav.planner.moving.problem import MovingConfig, MovingProblem, Steps
from nerfnav.planner.moving.spline import Points, SplinePlan, progress
from nerfnav.planner.moving.timetable import Timetable

_NO_PATH = 1e29
_NEAR_COST = 0.5
"""Cost of a cell near an obstacle, in squared cells of a step aside."""
_DEPTH_COST = 100.0
"""Weight of squared depths in obstacles, beside squared third differences."""
_AT_REST = 3
"""Control points at the goal: as many as the state at a knot depends on."""


@dataclass(frozen=True)
class _Grid:
    """Cells across in which a path is searched."""

    origin: Float[np.ndarray, "2"]
    cell: float
    shape: tuple[int, int]
    reach: tuple[int, int]

    def cell_of(self, place: Float[np.ndarray, "2"]) -> Int[np.ndarray, "2"]:
        index = np.rint((place - self.origin) / self.cell).astype(int)
        return index.clip(0, np.array(self.shape) - 1)


def plan_among(
    problem: MovingProblem, config: MovingConfig | None = None, timetable: Timetable | None = None
) -> SplinePlan | None:
    """Plan from start to goal among obstacles whose motion is known; None where no way is found.

    `timetable` saves placing the obstacles again.
    """
    config = config or MovingConfig()
    table = timetable or Timetable(problem, config)
    start = np.tile(np.array(problem.start, float), (3, 1))
    return next(find_plans(table, start), None)


def find_plans(table: Timetable, fixed: Points, most: int | None = None) -> Iterator[SplinePlan]:
    """Find plans that begin with fixed control points, the fastest first, in at most `most` attempts; None: all."""
    problem, config = table.problem, table.config
    steps = Steps.of(problem.limits, config.layer_s)
    coarse = min(config.cell, steps.y, steps.z)
    attempts = [(share, 0, cell) for share in config.speeds for cell in (coarse, coarse / 2)]
    attempts += [(1.0, round(wait / config.layer_s), coarse) for wait in config.waits_s]
    if most is not None:
        attempts = attempts[: 2 * most : 2]  # the coarse ones alone
    for share, wait, cell in attempts:
        plan = _attempt(table, fixed, steps, share * steps.ahead, wait, cell)
        if plan is not None:
            yield plan


def _attempt(
    table: Timetable, fixed: Points, steps: Steps, speed: float, wait: int, cell: float
) -> SplinePlan | None:
    """Plan with one speed [m a layer] and one size of cells."""
    problem, config = table.problem, table.config
    goal, last = np.array(problem.goal), fixed[-1]
    ahead = progress(float(last[0] - fixed[-2, 0]), goal[0] - last[0], speed, steps.gain, wait)
    if ahead is None:
        return None
    across = int(np.ceil(np.abs(goal[1:] - last[1:]).max() / cell)) + 1
    count = max(len(ahead) + 1, across + _AT_REST)
    points = np.concatenate([fixed, np.tile(goal, (count, 1))])
    points[len(fixed) : len(fixed) + len(ahead) - 1, 0] = last[0] + np.cumsum(ahead[:-1])
    sampled = SplinePlan(points, config.layer_s, problem.axes).path(config.parts)[:, 0].copy()
    centers = table.centers(len(sampled))
    layers = count - _AT_REST + 1
    grid = _grid_of(problem, steps, last[1:], cell)
    levels = np.zeros((layers, *grid.shape), np.uint8)
    margins = np.array([config.blocked_m, config.near_m])
    mark_layers(
        levels, len(fixed) - 1, sampled, centers, table.halves, grid.origin, grid.cell, config.parts, margins
    )
    found = np.zeros((layers, 2), np.int64)
    ends = grid.cell_of(last[1:]), grid.cell_of(goal[1:])
    if cheapest_layers(levels, *ends, np.array(grid.reach), _NEAR_COST, found) > _NO_PATH:
        return None
    points[len(fixed) : len(fixed) + layers - 1, 1:] = grid.origin + grid.cell * found[1:]
    _smooth(points, len(fixed), table, steps, sampled)
    plan = SplinePlan(points, config.layer_s, problem.axes)
    return plan if plan.keeps(problem.limits) and table.is_free(plan, max(0, len(fixed) - 3)) else None


def _grid_of(problem: MovingProblem, steps: Steps, place: Float[np.ndarray, "2"], cell: float) -> _Grid:
    """Cells of the region, of which one has its middle at `place`."""
    lower, upper = np.array(problem.lower[1:]), np.array(problem.upper[1:])
    origin = place - cell * np.floor((place - lower) / cell + 1e-9)
    ny, nz = (np.floor((upper - origin) / cell + 1e-9).astype(int) + 1).clip(1)
    return _Grid(origin, cell, (int(ny), int(nz)), (int(steps.y / cell + 1e-9), int(steps.z / cell + 1e-9)))


def _smooth(points: Points, fixed: int, table: Timetable, steps: Steps, ahead: Float[np.ndarray, " m"]) -> None:
    """Lower the third differences of the free control points in place."""
    problem, config, centers = table.problem, table.config, table.centers(len(ahead))
    starts, near = np.zeros(len(ahead) + 1, np.int64), np.zeros(16 * len(ahead), np.int64)
    reach = problem.limits.speed * config.layer_s / config.parts  # at most a step's way
    count = list_near(ahead, centers, table.halves, reach, starts, near)
    if count > len(near):
        near = np.zeros(count, np.int64)
        list_near(ahead, centers, table.halves, reach, starts, near)
    bounds = np.array([problem.lower[1:], problem.upper[1:]]).T.copy()
    world = (centers, table.halves, starts, near, config.smooth_m)
    smooth_points(
        points, np.array([fixed, 3]), np.array([steps.y, steps.z]), bounds, config.parts, world, _DEPTH_COST,
        config.sweeps,
    )  # fmt: skip
