"""Trajectories for the Crazyflie's high-level commander: CSV of polynomial pieces, as uav_trajectories writes them.

Each line is a piece: its duration [s], then eight coefficients c_0 ... c_7 for x, y, z [m] (world, ENU) and for the
yaw [rad, counter-clockwise from east], with value(t) = sum c_j t^j and t from 0 at the beginning of the piece.

The pieces are a smoothing spline (nerfnav.export.splines) near the smooth curve of the recording
(nerfnav.export.curves), whose position, velocity and acceleration it follows; it begins and ends as that does. What it
asks of the robot is found by differential flatness, and it is flown more slowly as far as the robot's limits demand
that. The vehicle's memory holds no more than 31 pieces; crazyswarm2 reads no file of a single one. Durations are
multiples of 2^-16 s, so that their sum is exact in whatever order it is taken.
"""

import math

import numpy as np
import torch

from nerfnav.export.curves import Curve, curve_of, quadrotor_of, slow_down
from nerfnav.export.flatness import QuadrotorLimits, peak_demands, slowdown_within
from nerfnav.export.recording import Exported, Recording
from nerfnav.export.refusal import NoCurveError
from nerfnav.export.splines import ORDER, Samples, fit
from nerfnav.export.tables import csv_lines
from nerfnav.planner import PiecewisePolynomial

MOST_PIECES, _FEWEST_PIECES = 31, 2
"""Pieces that fit the vehicle's memory of 4 kB at 132 bytes each, and that all loaders read."""
_TICK = 2.0**-16  # [s]
_BOUND_M = 0.05
"""Largest error of the fit; above it the export is refused [m]."""
_STEPS_PER_PIECE, _SAMPLES_PER_STEP = 2, 4
"""Time steps that a piece covers, as far as the memory allows, and instants of a step at which the curve is followed.
"""
_SCALES = (0.01, 0.1, 1.0)
"""Differences of position [m], velocity [m/s] and acceleration [m/s^2] that weigh alike; for the yaw in rad."""
_SMOOTHING = 1e-6
"""Weight of the squared snap [s^7]."""


def crazyflie(recording: Recording, thrust_per_weight: float | None = None) -> Exported:
    """Fit polynomial pieces to the curve; the info holds the largest error and the demands on the robot.

    `thrust_per_weight` is the most thrust as a share of the weight, for a vehicle that has less of it than the robot;
    None: the robot's. Raises NoCurveError where no 31 pieces come within the bound, or the robot's limits are not
    kept even slowly.
    """
    curve, limits = curve_of(recording), QuadrotorLimits.of(quadrotor_of(recording))
    if thrust_per_weight is not None:
        limits = limits.with_thrust(thrust_per_weight)
    steps = len(recording.times) - 1
    count = max(_FEWEST_PIECES, min(MOST_PIECES, steps // _STEPS_PER_PIECE))
    at = np.linspace(0.0, curve.duration, steps * _SAMPLES_PER_STEP + 1)
    shape = _fitted(curve, at, count)
    off = np.abs(shape(torch.from_numpy(at)).numpy() - curve.at(at))
    if (worst := float(np.linalg.norm(off[:, :3], axis=-1).max())) > _BOUND_M:
        raise NoCurveError(
            f"polynomials follow this curve only to {100 * worst:.1f} cm, and {100 * _BOUND_M:.0f} cm "
            f"is the bound: export less than these {curve.duration:.0f} s, for {MOST_PIECES} pieces are the most"
        )
    flown = slow_down(curve, slowdown_within(shape, limits))
    duration = math.ceil(flown.duration / count / _TICK) * _TICK
    shape = PiecewisePolynomial(duration * torch.arange(count + 1, dtype=torch.float64), shape.coefficients)
    info = {
        "pieces": count, "max_fit_error_m": worst, "max_fit_error_rad": float(off[:, 3].max()),
        "motion": flown.motion, "stretched_by": curve.stretched_by * duration * count / curve.duration,
        "off_rows_m": flown.off_m,
    }  # fmt: skip
    return Exported(_csv(shape), info | demands_of(shape, limits), shape)


def demands_of(shape: PiecewisePolynomial, limits: QuadrotorLimits) -> dict[str, float]:
    """Demands of a curve on a quadrotor, as exports report them."""
    most = peak_demands(shape, limits)
    return {
        "duration_s": float(shape.times[-1]),
        "max_thrust_n": most["thrust"],
        "max_tilt_deg": math.degrees(most["tilt"]),
        "max_body_rate_radps": most["body rate"],
        "max_speed_mps": most["speed"],
        "end_speed_mps": float(shape(shape.times[-1:], 1)[0, :3].norm()),
    }


def _fitted(curve: Curve, times: np.ndarray, count: int) -> PiecewisePolynomial:
    known = tuple(curve.at(times, order) for order in range(3))
    ends = tuple(values[[0, -1]] for values in known)
    return fit(Samples(times, known, _SCALES, ends), count, _SMOOTHING)


def _csv(shape: PiecewisePolynomial) -> bytes:
    header = ["duration", *(f"{axis}^{j}" for axis in ("x", "y", "z", "yaw") for j in range(ORDER + 1))]
    spans = shape.times.diff().numpy()
    powers = np.swapaxes(shape.coefficients.numpy() / spans[:, None, None] ** np.arange(ORDER + 1)[:, None], 1, 2)
    pieces = [
        [repr(float(span)), *(f"{value:.12g}" for value in piece.reshape(-1))]
        for span, piece in zip(spans, powers, strict=True)
    ]
    return csv_lines([header, *pieces]).encode()
