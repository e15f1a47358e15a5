"""Replanning among moving obstacles: keep the plan unless it became unsafe, or another one is better by a margin.

A replan keeps the control points that the flight until its first free knot depends on, so that the motion stays twice
continuously differentiable and within its limits.
"""

import math
from dataclasses import dataclass, replace

from nerfnav.core.errors import InvalidInputError
from nerfnav.obstacles import ObstacleSet
from nerfnav.planner.moving.problem import MovingConfig, MovingProblem
from nerfnav.planner.moving.search import find_plans, plan_among
from nerfnav.planner.moving.spline import SplinePlan
from nerfnav.planner.moving.timetable import Timetable

_ATTEMPTS = 2
"""Speeds that are tried while the present plan is safe."""


@dataclass(frozen=True)
class Replanned:
    """Outcome of one replan."""

    plan: SplinePlan
    """Plan to follow from now on."""
    safe: bool
    """It keeps its margin from all obstacles; False: no such plan was found."""
    changed: bool
    """It is another one than before."""


class Replanner:
    """Plan of a flight that is under way, and what may replace it."""

    def __init__(self, problem: MovingProblem, config: MovingConfig | None = None) -> None:
        """Make the first plan. Raises InvalidInputError where no way is found."""
        self._table = Timetable(problem, config or MovingConfig())
        plan = plan_among(problem, self._table.config, self._table)
        if plan is None:
            raise InvalidInputError("no way between the obstacles was found, at no speed and not by waiting")
        self.plan = plan

    def announce(self, obstacles: ObstacleSet) -> None:
        """Take other obstacles, or other motions of them, from now on; their time goes on from the start."""
        self._table = Timetable(replace(self._table.problem, obstacles=obstacles), self._table.config)

    def update(self, time: float) -> Replanned:
        """Replan at a time of the flight [s]."""
        table, config = self._table, self._table.config
        knot = math.ceil((time + config.latency_s) / config.layer_s)
        now = min(int(time / config.layer_s), len(self.plan.points) - 4)
        safe = table.is_free(self.plan, max(0, now))
        if knot + 3 >= len(self.plan.points):
            return Replanned(self.plan, safe, changed=False)
        fixed = self.plan.points[: knot + 3]
        best = next(find_plans(table, fixed, _ATTEMPTS if safe else None), None)
        if best is None:
            return Replanned(self.plan, safe, changed=False)
        cost = best.cost(knot, config.jerk_cost)
        if safe and cost >= (1 - config.better_by) * self.plan.cost(knot, config.jerk_cost):
            return Replanned(self.plan, safe, changed=False)
        self.plan = best
        return Replanned(best, safe=True, changed=True)
