"""Inertial motion: between two pictures an inertial measurement unit predicts, an extension of the paper's filter.

The paper predicts by the robot's dynamics and the action that it took (Eqs. 3-4). Here gyroscope and accelerometer take
their place, and their biases b = (bg, ba) are part of the state. With measurements w_i, a_i over steps dt_i, from
R = 1, v = p = 0 (preintegration: Forster, Carlone, Dellaert and Scaramuzza, "On-manifold preintegration for real-time
visual-inertial odometry", 2017, Eqs. 33 and 59-63):

    h = (w_i - bg) dt / 2,   f = R Exp(h) (a_i - ba),   p += v dt + f dt^2 / 2,   v += f dt,   R <- R Exp(2 h)

w_i and a_i being means of neighbouring measurements (midpoint rule); and over the time T between the pictures, with
gravity g:

    R' = R0 R,   v' = v0 + g T + R0 v,   p' = p0 + v0 T + g T^2 / 2 + R0 p,   w' = w_last - bg

A picture tells the pose, not the biases. Those follow by their regression on the state, which loses nothing, for the
picture depends on them through the state alone:

    K = Sigma_bx Sigma_xx^-1,   b+ = b + K (x+ (-) x-),   Sigma_bb+ = Sigma_bb - K (Sigma_xx - Sigma_xx+) K'

The state's body is the unit itself, so that the camera's mount is T_imu_camera; the world is z-up, in metres.
"""

from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.errors import InvalidInputError
from nerfnav.estimator import Belief
from nerfnav.geometry import so3
from nerfnav.robots import ATTITUDE, BODY_RATE, POSITION, TANGENT, VELOCITY, RigidState
from nerfnav.tracking.frame import Inertial

_TURN, _SPEED, _PLACE = slice(0, 3), slice(3, 6), slice(6, 9)
"""Where the parts stand in what is preintegrated."""
_GYRO, _ACCEL = slice(0, 3), slice(3, 6)


@dataclass(frozen=True)
class ImuConfig:
    """How well a unit measures; the defaults are those of the cheap ones that fly."""

    gyro: float = 2e-3
    """Noise of body rates [rad/s per sqrt(Hz)]."""
    accel: float = 2e-2
    """Noise of accelerations [m/s^2 per sqrt(Hz)]."""
    gyro_walk: float = 2e-5
    """How fast the gyroscope's bias strays [rad/s^2 per sqrt(Hz)]."""
    accel_walk: float = 3e-3
    """The same of the accelerometer's [m/s^3 per sqrt(Hz)]."""
    gyro_bias: float = 0.05
    """Standard deviation of the gyroscope's bias at first [rad/s]."""
    accel_bias: float = 0.3
    """The same of the accelerometer's [m/s^2]."""
    gravity: float = 9.81
    """[m/s^2]"""
    longest_gap: float = 0.1
    """Longest time without a measurement [s]."""


@dataclass(frozen=True)
class InertialBelief:
    """What is believed of the state, and of the biases with it."""

    belief: Belief
    """The state."""
    biases: Float[Tensor, "6"]
    """Of gyroscope [rad/s] and accelerometer [m/s^2]."""
    covariance: Float[Tensor, "6 6"]
    """Of the biases."""
    cross: Float[Tensor, "6 12"]
    """Of biases and state."""

    @classmethod
    def begin(cls, belief: Belief, config: ImuConfig) -> "InertialBelief":
        """Nothing is known of the biases but their usual size."""
        std = torch.tensor([config.gyro_bias] * 3 + [config.accel_bias] * 3, dtype=torch.float64)
        return cls(belief, torch.zeros(6).double(), torch.diag(std.square()), torch.zeros(6, TANGENT).double())

    def corrected(self, posterior: Belief) -> "InertialBelief":
        """With the state as a picture has corrected it, and the biases that follow."""
        before = self.belief.covariance.double()
        gain = torch.linalg.solve(before, self.cross.T).T
        change = self.belief.mean.local(posterior.mean).double()
        after = posterior.covariance.double()
        covariance = self.covariance - gain @ (before - after) @ gain.T
        return InertialBelief(
            posterior, self.biases + gain @ change, 0.5 * (covariance + covariance.T), gain @ after
        )  # fmt: skip


@dataclass(frozen=True)
class Preintegrated:
    """What a unit has measured between two times, in its own axes at the first."""

    rotation: Float[Tensor, "3 3"]
    velocity: Float[Tensor, "3"]
    position: Float[Tensor, "3"]
    rate: Float[Tensor, "3"]
    """The last body rate, without bias [rad/s]."""
    rate_variance: float
    """Of the last body rate [rad^2/s^2]."""
    duration: float
    by_biases: Float[Tensor, "9 6"]
    """Derivative of turn, velocity and position by the biases."""
    covariance: Float[Tensor, "9 9"]
    """Of turn, velocity and position."""


def preintegrated(
    inertial: Inertial, start: float, end: float, biases: Float[Tensor, "6"], config: ImuConfig
) -> Preintegrated:
    """Integrate from a time [s] to another; what is measured changes linearly in between.

    Raises InvalidInputError where measurements are missing for longer than `longest_gap`.
    """
    times, rates, forces = _between(inertial, start, end, config.longest_gap)
    rotation, velocity, position = torch.eye(3).double(), torch.zeros(3).double(), torch.zeros(3).double()
    by_biases, covariance = torch.zeros(9, 6).double(), torch.zeros(9, 9).double()
    density = torch.tensor([config.gyro**2] * 3 + [config.accel**2] * 3, dtype=torch.float64)
    means = (0.5 * (part[1:] + part[:-1]) for part in (rates - biases[_GYRO], forces - biases[_ACCEL]))
    for dt, rate, force in zip(times.diff().tolist(), *means, strict=True):
        half, turn, eye = 0.5 * dt * rate, so3.exp(rate * dt), torch.eye(3).double()
        middle = rotation @ so3.exp(half)
        step, by = torch.eye(9).double(), torch.zeros(9, 6).double()
        step[_TURN, _TURN] = turn.T
        step[_SPEED, _TURN] = -rotation @ so3.hat(so3.exp(half) @ force) * dt
        step[_PLACE, _TURN] = 0.5 * dt * step[_SPEED, _TURN]
        step[_PLACE, _SPEED] = dt * eye
        by[_TURN, _GYRO] = -so3.right_jacobian(rate * dt) * dt
        by[_SPEED, _GYRO] = 0.5 * dt**2 * middle @ so3.hat(force) @ so3.right_jacobian(half)
        by[_SPEED, _ACCEL] = -middle * dt
        by[_PLACE] = 0.5 * dt * by[_SPEED]
        by_biases = step @ by_biases + by
        covariance = step @ covariance @ step.T + (by * density) @ by.T / dt
        push = middle @ force
        position = position + velocity * dt + 0.5 * push * dt**2
        velocity, rotation = velocity + push * dt, rotation @ turn
    last, held = rates[-1] - biases[_GYRO], float(times[-1] - times[-2])
    return Preintegrated(
        rotation, velocity, position, last, config.gyro**2 / held, end - start, by_biases, covariance
    )  # fmt: skip


def predict(last: InertialBelief, measured: Preintegrated, config: ImuConfig | None = None) -> InertialBelief:
    """The belief at the end of what was measured; its `belief` is what `FastFilter.correct` takes as prediction."""
    config = ImuConfig() if config is None else config
    mean, covariance = last.belief.mean.to(torch.float64), last.belief.covariance.double()
    turned, time = mean.rotation, measured.duration
    gravity = torch.tensor([0.0, 0.0, -config.gravity], dtype=torch.float64)
    after = RigidState(
        mean.position + mean.velocity * time + 0.5 * gravity * time**2 + turned @ measured.position,
        mean.velocity + gravity * time + turned @ measured.velocity,
        turned @ measured.rotation,
        measured.rate,
    )
    by_state, by_measured = _slopes(turned, measured)
    by_biases = by_measured @ measured.by_biases
    by_biases[BODY_RATE, _GYRO] = -torch.eye(3).double()
    noise = by_measured @ measured.covariance @ by_measured.T
    noise[BODY_RATE, BODY_RATE] = measured.rate_variance * torch.eye(3)
    both = by_state @ last.cross.T @ by_biases.T
    spread = by_state @ covariance @ by_state.T + both + both.T + by_biases @ last.covariance @ by_biases.T + noise
    cross = last.cross @ by_state.T + last.covariance @ by_biases.T
    walk = torch.tensor([config.gyro_walk**2] * 3 + [config.accel_walk**2] * 3, dtype=torch.float64)
    belief = Belief(after.to(last.belief.mean.position.dtype), (0.5 * (spread + spread.T)).to(last.belief.covariance))
    return replace(last, belief=belief, cross=cross, covariance=last.covariance + torch.diag(walk * time))


def _slopes(turned: Tensor, measured: Preintegrated) -> tuple[Float[Tensor, "12 12"], Float[Tensor, "12 9"]]:
    """Derivatives of the predicted state by the one before and by what was measured; `turned` is R0."""
    by_state, by_measured = torch.zeros(TANGENT, TANGENT).double(), torch.zeros(TANGENT, 9).double()
    eye = torch.eye(3).double()
    by_state[POSITION, POSITION] = by_state[VELOCITY, VELOCITY] = eye
    by_state[POSITION, VELOCITY] = measured.duration * eye
    by_state[POSITION, ATTITUDE] = -turned @ so3.hat(measured.position)
    by_state[VELOCITY, ATTITUDE] = -turned @ so3.hat(measured.velocity)
    by_state[ATTITUDE, ATTITUDE] = measured.rotation.T
    by_measured[POSITION, _PLACE] = by_measured[VELOCITY, _SPEED] = turned
    by_measured[ATTITUDE, _TURN] = eye
    return by_state, by_measured


def _between(inertial: Inertial, start: float, end: float, longest: float) -> tuple[Tensor, Tensor, Tensor]:
    """Times from `start` to `end`, and what was measured then."""
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
