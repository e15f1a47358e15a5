"""Smooth curves of x, y, z [m] and yaw [rad] over time, as vehicles follow them, from the rows of a recording.

The discrete dynamics hold a velocity v_k for the whole step from t_k to t_k+1 and jump to the next, so neither v_k nor
its differences belong to the instant t_k. The curve of a plan is the uniform cubic B-spline whose control points are
the positions p_k, h apart in time. At t_k it has the central differences

    v = (p_k+1 - p_k-1) / (2 h)        a = (p_k+1 - 2 p_k + p_k-1) / h^2        p = p_k + a h^2 / 6

and at every time its velocity is the derivative of its position, and its acceleration that of its velocity. Between
the rows each of the three is a weighted mean of theirs: the curve cuts corners, by a h^2 / 6, never swings out of
them, and asks for no more thrust, tilt and speed than the plan does. A start at rest is met at rest, and so is a goal,
one step after the last row; both unaccelerated.

A flight is pushed at every step: the executed path and the estimate jump. Their curve is the smoothest spline whose
distances from the rows are no more in the root mean square than those jumps, and nowhere more than a bound; it begins
and ends at rest, unaccelerated. All are slowed down as far as the robot's limits ask for it.
"""

from dataclasses import dataclass, replace

import numpy as np
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.export.flatness import QuadrotorLimits, slowdown_within
from nerfnav.export.recording import Recording, Subject
from nerfnav.export.refusal import NoCurveError
from nerfnav.export.splines import Samples, fit
from nerfnav.geometry import so3
from nerfnav.planner import PiecewisePolynomial, uniform_cubic
from nerfnav.robots import Quadrotor

MOTIONS = {
    Subject.PLAN: "the plan", Subject.EXECUTED: "the flown path, smoothed", Subject.ESTIMATE: "the estimate, smoothed",
}  # fmt: skip
"""Name of the curve of each subject, in files."""
_AT_REST = 1e-6  # [m/s]


@dataclass(frozen=True)
class SmoothConfig:
    """Options of the smoothing of executed paths and estimates."""

    smoothings: tuple[float, ...] = tuple(10.0**-power for power in range(2, 13))
    """Weights of the squared snap that are tried, the smoothest first [s^7]."""
    bound_m: float = 0.05
    """Largest distance of the curve from the rows [m]."""
    rows_per_piece: int = 2
    """Rows that a polynomial covers."""
    most_pieces: int = 600
    """Polynomials of a long flight."""


@dataclass(frozen=True)
class Curve:
    """Reference curve for a vehicle."""

    shape: PiecewisePolynomial
    """x, y, z [m], ENU, and yaw [rad], counter-clockwise from east."""
    motion: str
    """One of MOTIONS."""
    off_m: float
    """Largest distance from the rows [m]: corners that are cut, or jumps that are smoothed."""
    stretched_by: float = 1.0
    """Duration relative to the rows, to keep the robot's limits."""

    @property
    def duration(self) -> float:
        """Duration of the curve [s]."""
        return float(self.shape.times[-1])

    def at(self, times: np.ndarray, order: int = 0) -> np.ndarray:
        """(x, y, z, yaw), or a derivative, at times (n,) [s]: (n, 4)."""
        return self.shape(torch.from_numpy(np.array(times, dtype=np.float64)), order).numpy()


def curve_of(recording: Recording, config: SmoothConfig | None = None) -> Curve:
    """The curve of the subject of a recording.

    Raises InvalidInputError where the robot does not fly by tilting or fewer than three rows are there, NoCurveError
    where no smooth curve is near enough, or no slowness keeps the limits.
    """
    limits = QuadrotorLimits.of(quadrotor_of(recording))
    if len(recording.times) < 3:
        raise InvalidInputError(f"setpoints need at least three states, and there are {len(recording.times)}")
    plans = recording.subject is Subject.PLAN
    curve = _spline(recording) if plans else _smoothed(recording, config or SmoothConfig())
    return slow_down(curve, slowdown_within(curve.shape, limits))


def quadrotor_of(recording: Recording) -> Quadrotor:
    """The robot, if it is one that setpoints of drones can move. Raises InvalidInputError for any other."""
    if recording.robot is None:
        name = recording.table.info.get("robot", "")
        raise InvalidInputError(f"setpoints need to know their robot, and there is none named {name!r} here")
    if not isinstance(recording.robot, Quadrotor):
        raise InvalidInputError(
            f"setpoints of drones are for quadrotors, and {recording.robot.name} does not fly: export csv, json or mcap"
        )
    return recording.robot


def values_of(recording: Recording) -> np.ndarray:
    """x, y, z [m] and yaw [rad] of the rows, (n, 4)."""
    return np.concatenate([recording.position.numpy(), recording.yaw().numpy()[:, None]], -1)


def end_rates(recording: Recording) -> np.ndarray:
    """Velocities [m/s] and yaw rates [rad/s] of the first and the last row, (2, 4)."""
    rotation = so3.matrix_from_quaternion(recording.quaternion)
    yaw_rate = (rotation @ recording.body_rate[..., None])[..., 2, :]
    return torch.cat([recording.velocity, yaw_rate], -1)[[0, -1]].numpy()


def _spline(recording: Recording) -> Curve:
    times, values, ends = recording.times.numpy(), values_of(recording), end_rates(recording)
    step = float(times[-1]) / (len(times) - 1)
    if not np.allclose(np.diff(times), step, rtol=1e-3):
        raise InvalidInputError("setpoints are made of rows that are all as far apart in time, and these are not")
    rests = bool(np.linalg.norm(ends[1, :3]) < _AT_REST)
    after = [values[-1]] * 2 if rests else [values[-1] + step * ends[1]]
    points = np.concatenate([2 * values[:1] - values[1:2], values, after])
    shape = uniform_cubic(torch.from_numpy(points), step)
    off = np.linalg.norm((shape(torch.tensor(times)).numpy() - values)[:-1, :3], axis=-1)
    return Curve(shape, MOTIONS[recording.subject], float(off.max()))


def _smoothed(recording: Recording, config: SmoothConfig) -> Curve:
    times, values = recording.times.numpy(), values_of(recording)
    still = np.zeros((2, 4))
    samples = Samples(times, (values,), (1.0,), (values[[0, -1]], still, still))
    pieces = max(2, min(config.most_pieces, (len(times) - 1) // config.rows_per_piece))
    jump, most = jump_of(recording), np.inf
    for smoothing in config.smoothings:
        shape = fit(samples, pieces, smoothing)
        off = np.linalg.norm(shape(torch.tensor(times)).numpy()[:, :3] - values[:, :3], axis=-1)
        most = float(off.max())
        if np.sqrt(np.mean(off**2)) <= jump and most <= config.bound_m:
            return Curve(shape, MOTIONS[recording.subject], most)
    raise NoCurveError(
        f"no smooth curve is nearer to this flight than {100 * most:.1f} cm, and {100 * config.bound_m:.0f} cm is the "
        "bound"
    )


def slow_down(curve: Curve, factor: float) -> Curve:
    """Slow a curve down by a factor along the same path."""
    shape = PiecewisePolynomial(curve.shape.times * factor, curve.shape.coefficients)
    return replace(curve, shape=shape, stretched_by=curve.stretched_by * factor)


def jump_of(recording: Recording) -> float:
    """By how much the rows are off from where the velocity of the row before leads, root mean square [m]."""
    step = recording.times.diff()[:, None]
    jumps = recording.position.diff(dim=0) - recording.velocity[:-1] * step
    return float(jumps.square().sum(-1).mean().sqrt())
