"""Differential flatness: demands of a smooth curve on a quadrotor, and the slow-down that keeps them in its limits.

After Mellinger and Kumar, ICRA 2011.

With a, j acceleration and jerk, g gravity, m the mass: thrust f = m |a - g|, axis z_B = (a - g) / |a - g|, tilt the
angle of z_B from the vertical; h = (j - (z_B . j) z_B) / |a - g| gives the body rate
(-h . y_B, h . x_B, yaw' z_B . z_W), whose length needs no heading. Slower by a factor s,
velocities are divided by s, accelerations by s^2, jerks by s^3.
"""

from dataclasses import dataclass, replace

import numpy as np
import torch

from nerfnav.export.refusal import NoCurveError
from nerfnav.planner import PiecewisePolynomial
from nerfnav.robots import Quadrotor

_SAMPLES_PER_PIECE = 40
_GROWTH, _SLOWEST = 1.05, 6.0
_TOLERANCE = 1e-3


@dataclass(frozen=True)
class QuadrotorLimits:
    """Limits of a quadrotor."""

    mass: float
    """[kg]"""
    gravity: float
    """[m/s^2]"""
    most: dict[str, float]
    """By name: thrust [N], tilt [rad], speed [m/s], body rate [rad/s]."""

    @classmethod
    def of(cls, robot: Quadrotor) -> "QuadrotorLimits":
        """The bounds of a robot."""
        most = {bound.name: bound.upper for bound in robot.bounds if bound.upper is not None}
        return cls(robot.config.mass, robot.config.gravity, most)

    def with_thrust(self, per_weight: float) -> "QuadrotorLimits":
        """The same with no more thrust than so many times the weight, and no more tilt than that holds up."""
        less = {"thrust": per_weight * self.mass * self.gravity, "tilt": float(np.arccos(1 / per_weight))}
        return replace(self, most=self.most | {name: min(less[name], self.most.get(name, np.inf)) for name in less})


def peak_demands(shape: PiecewisePolynomial, limits: QuadrotorLimits) -> dict[str, float]:
    """The most that a curve of x, y, z [m] and yaw [rad] asks: thrust [N], tilt [rad], speed [m/s], body rate [rad/s].
    """
    return _peak_demands(_derivatives(shape), limits, 1.0)


def slowdown_within(shape: PiecewisePolynomial, limits: QuadrotorLimits) -> float:
    """Find the factor, at least 1, by which a curve must slow down to keep within bounds.

    Raises NoCurveError where no such factor up to 6 is found.
    """
    derivatives, factor = _derivatives(shape), 1.0
    while over := _over(_peak_demands(derivatives, limits, factor), limits):
        factor *= _GROWTH
        if factor > _SLOWEST:
            raise NoCurveError(f"the robot's limits are not kept even {_SLOWEST:g} times as slowly ({over})")
    return factor


def _derivatives(shape: PiecewisePolynomial) -> list[np.ndarray]:
    """Velocity, acceleration and jerk at many times of each piece."""
    share = torch.arange(_SAMPLES_PER_PIECE, dtype=torch.float64) / _SAMPLES_PER_PIECE
    times = shape.times[:-1, None] + share * shape.times.diff()[:, None]
    times = torch.cat([times.reshape(-1), shape.times[-1:]])
    return [shape(times, order).numpy() for order in range(1, 4)]


def _peak_demands(derivatives: list[np.ndarray], limits: QuadrotorLimits, factor: float) -> dict[str, float]:
    velocity, acceleration, jerk = (values / factor**order for order, values in enumerate(derivatives, 1))
    pull = acceleration[:, :3] + np.array([0.0, 0.0, limits.gravity])
    size = np.maximum(np.linalg.norm(pull, axis=-1), 1e-9)
    axis = pull / size[:, None]
    across = (jerk[:, :3] - (axis * jerk[:, :3]).sum(-1, keepdims=True) * axis) / size[:, None]
    rate = np.hypot(np.linalg.norm(across, axis=-1), velocity[:, 3] * axis[:, 2])
    return {
        "thrust": float(limits.mass * size.max()),
        "tilt": float(np.arctan2(np.hypot(axis[:, 0], axis[:, 1]), axis[:, 2]).max()),
        "speed": float(np.linalg.norm(velocity[:, :3], axis=-1).max()),
        "body rate": float(rate.max()),
    }


def _over(used: dict[str, float], limits: QuadrotorLimits) -> str:
    """Names and values above their bounds; empty where there are none."""
    broken = [name for name, bound in limits.most.items() if name in used and used[name] > (1 + _TOLERANCE) * bound]
    return ", ".join(f"{name} {used[name]:.3g} above {limits.most[name]:.3g}" for name in broken)
