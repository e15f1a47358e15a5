"""Preintegration of an IMU's measurements between two pictures, independent of the state.

(Forster, Carlone, Dellaert and Scaramuzza, "On-manifold preintegration for real-time visual-inertial odometry", 2017,
Eqs. 33 and 59-63.) With measurements w_i, a_i over steps dt_i, and biases bg, ba of gyroscope and accelerometer, from
R = 1, v = p = 0:

    h = (w_i - bg) dt / 2,   f = R Exp(h) (a_i - ba),   p += v dt + f dt^2 / 2,   v += f dt,   R <- R Exp(2 h)

w_i and a_i being means of neighbouring measurements (midpoint rule).
"""

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry import so3
from nerfnav.inertial import ImuConfig, Increments, integrate_step
from nerfnav.inertial.preintegrated import ACCEL, GYRO, PLACE, SPEED, TURN, Preintegrated
from nerfnav.tracking.frame import ImuMeasurements


def preintegrate(
    inertial: ImuMeasurements, start: float, end: float, biases: Float[Tensor, "6"], config: ImuConfig
) -> Preintegrated:
    """Integrate from a time [s] to another; measurements change linearly in between.

    Raises InvalidInputError where measurements are missing for longer than `longest_gap`.
    """
    times, rates, forces = _between(inertial, start, end, config.longest_gap)
    zero, way = np.zeros(3), times.diff()
    at = np.eye(3), zero, zero
    by_biases, covariance = np.zeros((9, 6)), np.zeros((9, 9))
    density = np.array([config.gyro**2] * 3 + [config.accel**2] * 3)
    rate, force = (0.5 * (part[1:] + part[:-1]) for part in (rates - biases[GYRO], forces - biases[ACCEL]))
    for dt, *parts in zip(way.tolist(), force.numpy(), *_turns(rate, force, way), strict=True):
        step, by = _slopes(at[0], parts, dt)
        by_biases = step @ by_biases + by
        covariance = step @ covariance @ step.T + (by * density) @ by.T / dt
        at = integrate_step(at, (parts[1], parts[2]), parts[0], zero, dt)
    turn, speed, moved = (torch.from_numpy(part) for part in at)
    increments, held = Increments(turn, speed, moved, rates[-1] - biases[GYRO]), float(way[-1])
    return Preintegrated(
        increments, config.gyro**2 / held, end - start, torch.from_numpy(by_biases), torch.from_numpy(covariance)
    )


def _turns(rate: Tensor, force: Tensor, dt: Float[Tensor, " n"]) -> tuple[np.ndarray, ...]:
    """Return the matrices of all steps (n, 3, 3).

    Half turns and turns, their right Jacobians, and hats of the forces, in the middle and at the beginning.
    """
    turn = rate * dt[:, None]
    half = so3.exp(0.5 * turn)
    begun = so3.hat((half @ force[..., None])[..., 0])
    parts = half, so3.exp(turn), so3.right_jacobian(0.5 * turn), so3.right_jacobian(turn), so3.hat(force), begun
    return tuple(part.numpy() for part in parts)


def _slopes(rotation: np.ndarray, parts: list[np.ndarray], dt: float) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives (9, 9) of a step's end by its beginning, and (9, 6) by the biases; `parts` are force and `_turns`."""
    _, half, turn, by_half, by_turn, pushed, begun = parts
    middle = rotation @ half
    step, by = np.eye(9), np.zeros((9, 6))
    step[TURN, TURN] = turn.T
    step[SPEED, TURN] = -dt * rotation @ begun
    step[PLACE, TURN] = 0.5 * dt * step[SPEED, TURN]
    step[PLACE, SPEED] = dt * np.eye(3)
    by[TURN, GYRO] = -dt * by_turn
    by[SPEED, GYRO] = 0.5 * dt**2 * middle @ pushed @ by_half
    by[SPEED, ACCEL] = -dt * middle
    by[PLACE] = 0.5 * dt * by[SPEED]
    return step, by


def _between(inertial: ImuMeasurements, start: float, end: float, longest: float) -> tuple[Tensor, Tensor, Tensor]:
    """Return times from `start` to `end`, and the measurements then."""
    if not end > start:
        raise InvalidInputError(f"motion is measured from one time to a later one, not from {start:g} s to {end:g} s")
    inside = (inertial.times > start) & (inertial.times < end)
    ends = torch.tensor([start, end], dtype=torch.float64)
    times = torch.cat([ends[:1], inertial.times[inside], ends[1:]])
    near = inertial.times[(inertial.times > start - longest) & (inertial.times < end + longest)]
    gaps = torch.cat([ends[:1], near.clamp(start, end), ends[1:]]).diff()
    if not len(near) or bool(gaps.max() > longest):
        raise InvalidInputError(
            f"between {start:.3f} s and {end:.3f} s the inertial measurements have a gap of more than {longest:g} s"
        )
    return times, _at(times, inertial.times, inertial.body_rates), _at(times, inertial.times, inertial.specific_forces)


def _at(times: Tensor, measured: Tensor, values: Tensor) -> Tensor:
    """Values (m, 3) between those (n, 3) that were measured; beyond the ends, the nearest."""
    columns = [np.interp(times.numpy(), measured.numpy(), column) for column in values.double().numpy().T]
    return torch.from_numpy(np.stack(columns, -1))
