"""Trajectories for the Crazyflie's high-level commander: CSV of polynomial pieces, as uav_trajectories writes them.

Each line is a piece: its duration [s], then eight coefficients c_0 ... c_7 for x, y, z [m] (world, ENU) and for the
yaw [rad, counter-clockwise from east], with value(t) = sum c_j t^j and t from 0 at the beginning of the piece.

The pieces are a smoothing spline through the positions of the states: least squares of the distances at the rows'
times plus `smoothing` times the integral of the squared snap, subject to continuous value, velocity, acceleration and
jerk where pieces meet, start and end met exactly with their velocities (a quadratic program with equality
constraints, solved by its KKT system; Mellinger and Kumar, ICRA 2011). The smoothest spline is taken that keeps within
a goal. Velocities in between are not fitted: the discrete dynamics hold them for a whole step, so they are the slopes
of the middles of steps, which the positions have already. The vehicle's memory holds no more than 31 pieces.
"""

import csv
import io
import math
from dataclasses import dataclass

import numpy as np
import scipy
import torch

from nerfnav.errors import InvalidInputError
from nerfnav.export.recording import Exported, Recording
from nerfnav.planner.polynomials import derivative_rows, squared_derivative

ORDER = 7
MOST_PIECES = 31
"""Pieces that fit the vehicle's memory of 4 kB at 132 bytes each."""
_SMOOTHNESS = 4  # derivatives 0 to 3 are continuous


@dataclass(frozen=True)
class FitConfig:
    """How closely the polynomials follow the states."""

    goal_m: float = 0.01
    """The spline gets less smooth until no position is off by more than this [m]."""
    bound_m: float = 0.05
    """What cannot be met within this is refused [m]."""
    steps_per_piece: int = 2
    """Time steps that a piece covers, as far as the memory allows."""
    smoothings: tuple[float, ...] = tuple(10.0**-power for power in range(3, 13))
    """Weights of the squared snap that are tried [s^7]."""


@dataclass(frozen=True)
class Pieces:
    """A piecewise polynomial."""

    duration: float
    """Of each piece [s]."""
    coefficients: np.ndarray
    """(pieces, 4, 8): of x, y, z [m] and yaw [rad], ascending powers of the time in the piece [s]."""

    def value(self, times: np.ndarray, derivative: int = 0) -> np.ndarray:
        """Values (n, 4), or their derivatives, at times (n,) from the start [s]."""
        piece = np.clip((times / self.duration).astype(int), 0, len(self.coefficients) - 1)
        basis = _powers(times - piece * self.duration, derivative)
        return np.einsum("nj,ndj->nd", basis, self.coefficients[piece])


def crazyflie(recording: Recording, config: FitConfig | None = None) -> Exported:
    """The states as polynomial pieces; says how far they are off at most.

    Raises InvalidInputError where no 31 pieces come within the bound.
    """
    config = config or FitConfig()
    times = recording.times.numpy()
    if len(times) < 2:
        raise InvalidInputError("a trajectory needs at least two states")
    values = np.concatenate([recording.position.numpy(), recording.yaw().numpy()[:, None]], -1)
    yaw_rates = np.diff(values[:, 3])[[0, -1]] / (times[1] - times[0])
    slopes = np.concatenate([recording.velocity.numpy()[[0, -1]], yaw_rates[:, None]], -1)
    count = max(1, min(MOST_PIECES, (len(times) - 1) // config.steps_per_piece))
    fitted, off = None, np.full((1, 4), math.inf)
    for smoothing in config.smoothings:
        fitted = fit(times, values, slopes, count, smoothing)
        off = np.abs(fitted.value(times) - values)
        if _distance(off) <= config.goal_m:
            break
    if fitted is None or not _distance(off) <= config.bound_m:
        raise InvalidInputError(
            f"polynomials follow these states only to {100 * _distance(off):.1f} cm, and {100 * config.bound_m:.0f} cm "
            "is the bound: export the plan, or a flight with less disturbance"
        )
    info = {"pieces": count, "max_fit_error_m": _distance(off), "max_fit_error_rad": float(off[:, 3].max())}
    return Exported(_csv(fitted), info)


def fit(times: np.ndarray, values: np.ndarray, slopes: np.ndarray, count: int, smoothing: float) -> Pieces:
    """The `count` pieces through values (n, d) at times (n,) [s], with slopes (2, d) at the two ends.

    The least squares have the weight 1, the integral of the squared fourth derivative the weight `smoothing` [s^7].
    """
    duration = float(times[-1]) / count
    piece = np.clip((times / duration).astype(int), 0, count - 1)
    rows = _rows(times / duration - piece, piece, count, 0)  # each piece runs from 0 to 1: that keeps the powers alike
    ends, at = np.array([0.0, 1.0]), np.array([0, count - 1])
    joints = [
        _rows(np.array([1.0]), np.array([k]), count, d) - _rows(np.array([0.0]), np.array([k + 1]), count, d)
        for k in range(count - 1)
        for d in range(_SMOOTHNESS)
    ]
    held = np.concatenate([_rows(ends, at, count, 0), _rows(ends, at, count, 1), *joints])
    zeros = np.zeros((len(held) - 4, values.shape[1]))
    right = np.concatenate([rows.T @ values, values[[0, -1]], duration * slopes, zeros])
    hessian = rows.T @ rows + smoothing / duration**7 * _snap(count)
    kkt = np.block([[hessian, held.T], [held, np.zeros((len(held), len(held)))]])
    solved = scipy.sparse.linalg.splu(scipy.sparse.csc_matrix(kkt)).solve(right)
    shares = solved[: count * (ORDER + 1)].reshape(count, ORDER + 1, -1)
    return Pieces(duration, np.swapaxes(shares / duration ** np.arange(ORDER + 1)[:, None], 1, 2))


def _distance(off: np.ndarray) -> float:
    """The largest distance [m] among differences of x, y, z, yaw."""
    return float(np.linalg.norm(off[:, :3], axis=-1).max())


def pieces_of_csv(text: str) -> tuple[np.ndarray, np.ndarray]:
    """Durations (pieces,) [s] and coefficients (pieces, 4, 8) of a file that `crazyflie` wrote."""
    _, *rows = csv.reader(io.StringIO(text))
    numbers = np.array(rows, dtype=np.float64)
    return numbers[:, 0], numbers[:, 1:].reshape(-1, 4, ORDER + 1)


def _powers(times: np.ndarray, derivative: int) -> np.ndarray:
    """The derivative of t^0 ... t^7 at each time, (n, 8)."""
    return derivative_rows(torch.from_numpy(times), derivative, ORDER + 1).numpy()


def _rows(times: np.ndarray, piece: np.ndarray, count: int, derivative: int) -> np.ndarray:
    """`_powers` where the coefficients of all pieces stand side by side, (n, 8 count)."""
    rows = np.zeros((len(times), count, ORDER + 1))
    rows[np.arange(len(times)), piece] = _powers(times, derivative)
    return rows.reshape(len(times), -1)


def _snap(count: int) -> np.ndarray:
    """The integral of the squared fourth derivative over all pieces, as a quadratic form of the coefficients."""
    return np.kron(np.eye(count), squared_derivative(4, ORDER + 1).numpy())


def _csv(pieces: Pieces) -> bytes:
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["duration", *(f"{axis}^{j}" for axis in ("x", "y", "z", "yaw") for j in range(ORDER + 1))])
    for piece in pieces.coefficients:
        writer.writerow([f"{value:.12g}" for value in (pieces.duration, *piece.reshape(-1))])
    return stream.getvalue().encode()
