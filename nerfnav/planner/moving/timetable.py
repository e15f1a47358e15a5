"""Timetable: where the boxes around all obstacles are at equal steps in time, enlarged by the robot.

It grows as plans look further ahead, so that replanning evaluates no motion again.
"""

import numpy as np
from jaxtyping import Float

from nerfnav.planner.kernels.moving import first_contact
from nerfnav.planner.moving.problem import MovingConfig, MovingProblem
from nerfnav.planner.moving.spline import SplinePlan

_AT_ONCE = 64
"""Layers by which it grows, at least."""


class Timetable:
    """Boxes of a problem's obstacles in its frame."""

    def __init__(self, problem: MovingProblem, config: MovingConfig) -> None:
        """Begin with an empty table."""
        self.problem, self.config = problem, config
        boxes = problem.obstacles.boxes([], problem.axes)
        self.halves = boxes.halves + np.array(problem.half_extents)
        self._centers = boxes.centers

    def centers(self, steps: int) -> Float[np.ndarray, "m k 3"]:
        """Middles of the boxes at the first `steps` steps [m]."""
        known = len(self._centers)
        if known < steps:
            count = max(steps - known, _AT_ONCE * self.config.parts)
            clock = (known + np.arange(count)) * (self.config.layer_s / self.config.parts)
            more = self.problem.obstacles.boxes(clock, self.problem.axes).centers
            self._centers = np.ascontiguousarray(np.concatenate([self._centers, more]))
        return self._centers[:steps]

    def is_free(self, plan: SplinePlan, first_knot: int = 0) -> bool:
        """Check that a plan keeps its margin from all obstacles from a knot on."""
        path = plan.path(self.config.parts)
        begin = first_knot * self.config.parts
        return first_contact(path, begin, self.centers(len(path)), self.halves, self.config.margin_m) < 0
