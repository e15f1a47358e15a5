"""Spline: a uniform cubic B-spline in time, whose control points bound its velocity, acceleration and jerk.

With control points P_i and h seconds between them, velocity, acceleration and jerk lie between the differences
(P_i+1 - P_i) / h, (P_i+2 - 2 P_i+1 + P_i) / h^2 and (P_i+3 - 3 P_i+2 + 3 P_i+1 - P_i) / h^3 (convex hull). Knot k is at
k h seconds: the state there depends on points k, k + 1 and k + 2 alone.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from nerfnav.planner.kernels.moving import sample_spline
from nerfnav.planner.moving.problem import Matrix, MotionLimits

Points = Float[np.ndarray, "n 3"]
_BASIS = np.array([[1, 4, 1, 0], [-3, 0, 3, 0], [3, -6, 3, 0], [-1, 3, -3, 1]]) / 6.0
"""Coefficients of 1, u, u^2, u^3 in a segment, of its four control points."""
_ROUNDING = 1e-9


@dataclass(frozen=True)
class SplinePlan:
    """Motion from rest to rest, in the frame of its problem."""

    points: Points
    """Control points, at least 4 [m]."""
    layer_s: float
    """Time between them [s]."""
    axes: Matrix
    """Axes of the frame in the world, as rows."""

    @property
    def duration(self) -> float:
        """Time of the last knot [s]."""
        return (len(self.points) - 3) * self.layer_s

    def derivative(self, times: Float[np.ndarray, " m"], order: int = 0) -> Float[np.ndarray, "m 3"]:
        """Position, velocity, acceleration or jerk in the world at times [s]; the end is kept after the last knot."""
        share = np.clip(times, 0.0, self.duration) / self.layer_s
        knot = np.minimum(share.astype(int), len(self.points) - 4)
        u = (share - knot)[:, None]
        near = self.points[knot[:, None] + np.arange(4)]
        found = np.zeros((len(times), 3))
        for power in range(order, 4):
            factor = np.prod(np.arange(power - order + 1, power + 1))
            found += factor * u ** (power - order) * np.einsum("k,mka->ma", _BASIS[power], near)
        ended = (times > self.duration) & (order > 0)
        found[ended] = 0.0
        return found / self.layer_s**order @ self.axes

    def path(self, parts: int) -> Points:
        """Positions in the frame at `parts` steps of each layer [m]."""
        found = np.empty(((len(self.points) - 3) * parts + 1, 3))
        sample_spline(self.points, parts, found)
        return found

    def keeps(self, limits: MotionLimits) -> bool:
        """Check that no limit of motion is exceeded anywhere, by the control points."""
        velocity, acceleration, jerk = (
            np.diff(self.points, order, axis=0) / self.layer_s**order for order in (1, 2, 3)
        )
        pairs = ((velocity, limits.speed), (acceleration, limits.acceleration), (jerk, limits.jerk))
        most = all(np.abs(values).max() <= limit * (1 + _ROUNDING) for values, limit in pairs)
        return most and bool(acceleration[:, 2].min() >= -limits.fall * (1 + _ROUNDING))

    def cost(self, first_knot: int, jerk_cost: float) -> float:
        """Time from a knot to the end [s], and the integral of the squared jerk over it, times `jerk_cost`."""
        jerk = np.diff(self.points[first_knot:], 3, axis=0) / self.layer_s**3
        return self.duration - first_knot * self.layer_s + jerk_cost * self.layer_s * float((jerk**2).sum())


def progress(step: float, remaining: float, most: float, gain: float, wait: int = 0) -> list[float] | None:
    """Steps of control points along x from a last `step` to rest after `remaining` metres; None where that is too near.

    No step is larger than `most`, and neighbours differ by at most `gain` [m]. With `wait` it comes to rest first, for
    so many steps.
    """
    halted = _ramp(step, 0.0, gain) + [0.0] * wait if wait else []
    left, step = remaining - sum(halted), 0.0 if wait else step
    least, peak = 0.0, most

    def needed(peak: float) -> float:
        return sum(_ramp(step, peak, gain)) + sum(_ramp(peak, 0.0, gain))

    if needed(0.0) > left + 1e-9:
        return None
    if needed(most) > left:
        for _ in range(50):
            middle = 0.5 * (least + peak)
            least, peak = (middle, peak) if needed(middle) <= left else (least, middle)
        peak = least
    up, down = _ramp(step, peak, gain), _ramp(peak, 0.0, gain)
    rest = left - sum(up) - sum(down)
    cruise = int(rest / peak + 1e-9) if peak > 1e-6 * most else 0
    rest -= cruise * peak
    down = sorted([*down, max(0.0, rest)], reverse=True)
    return [*halted, *up, *[peak] * cruise, *down]


def _ramp(first: float, last: float, gain: float) -> list[float]:
    """Steps after `first` up to `last`, that one included."""
    count = max(1, int(np.ceil(abs(last - first) / gain - 1e-9)))
    return [first + (last - first) * (index + 1) / count for index in range(count)]
