"""Inertial measurements, and propagation of states by them, in the notation of inertial/strapdown.py."""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.geometry import so3
from nerfnav.inertial import ImuConfig, Increments, integrate_step
from nerfnav.inertial.preintegrated import ACCEL, GYRO, PLACE, SPEED, TURN, Preintegrated
from nerfnav.navigation.physical.config import PhysicalConfig
from nerfnav.navigation.physical.rigid_body import BodyState, rotation_of

_PERFECT = 1e-6
"""Least noise of a unit: covariances are inverted."""


@dataclass
class InertialUnit:
    """Gyroscopes and accelerometers in the middle of the body, with white noise and constant biases."""

    config: PhysicalConfig
    """Noise densities and biases."""
    generator: torch.Generator
    """Draws their errors."""

    def __post_init__(self) -> None:
        """Draw the biases."""
        std = np.repeat([self.config.gyroscope_bias_radps, self.config.accelerometer_bias_mps2], 3)
        self._bias = std * torch.randn(6, generator=self.generator, dtype=torch.float64).numpy()
        density = np.repeat([self.config.gyroscope_noise, self.config.accelerometer_noise], 3)
        self._white = density * self.config.control_hz**0.5

    def describe(self, gravity: float) -> ImuConfig:
        """Describe the unit as the filter knows it, without its biases, at a gravity [m/s^2]."""
        config = self.config
        noise = (max(_PERFECT, density) for density in (config.gyroscope_noise, config.accelerometer_noise))
        return ImuConfig(
            *noise, gyro_walk=0.0, accel_walk=0.0,
            gyro_bias=config.gyroscope_bias_radps, accel_bias=config.accelerometer_bias_mps2,
            gravity=gravity, gravity_std=0.0,
        )  # fmt: skip

    def measure(self, body_rate: np.ndarray, specific_force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Measure an angular velocity [rad/s] and a specific force [m/s^2]."""
        off = self._bias + self._white * torch.randn(6, generator=self.generator, dtype=torch.float64).numpy()
        return body_rate + off[:3], specific_force + off[3:]


def integrate_imu(
    state: BodyState, body_rate: np.ndarray, force: np.ndarray, turning: np.ndarray, gravity: float, dt: float
) -> BodyState:
    """Propagate a state over `dt` [s] by a measured angular velocity [rad/s] and specific force [m/s^2] in the body.

    Gyroscopes measure the mean over that time, which is the angular velocity at its middle. At its end it is

        w = w_measured + dt / 2 w'

    up to the second order, with the angular acceleration w' (`turning` [rad/s^2]) that the rotors bring about.
    """
    at = state.rotation, state.velocity, state.position
    turns = rotation_of(0.5 * dt * body_rate), rotation_of(dt * body_rate)
    rotation, velocity, position = integrate_step(at, turns, force, np.array([0.0, 0.0, -gravity]), dt)
    return BodyState(position, velocity, rotation, body_rate + 0.5 * dt * turning)


@dataclass(frozen=True)
class InertialInterval:
    """Inertial measurements over an interval, with their biases."""

    increments: Increments
    """Turn, speed and way, and the last angular velocity."""
    duration: float
    """Of the interval [s]."""
    tick: float
    """Time between two measurements [s]."""

    @classmethod
    def between(
        cls, before: BodyState, after: BodyState, gravity: float, duration: float, tick: float
    ) -> "InertialInterval":
        """Measurements that take one state to the other in a `duration` [s], one in each `tick` [s]."""
        fall = np.array([0.0, 0.0, -gravity]) * duration
        turn = so3.project(torch.from_numpy(before.rotation.T @ after.rotation))  # what beliefs are turned by stays one
        speed = before.rotation.T @ (after.velocity - before.velocity - fall)
        way = before.rotation.T @ (after.position - before.position - (before.velocity + 0.5 * fall) * duration)
        speed, way, rate = (torch.from_numpy(part) for part in (speed, way, after.body_rate))
        return cls(Increments(turn, speed, way, rate), duration, tick)

    def without(self, biases: Float[Tensor, "6"], unit: ImuConfig) -> Preintegrated:
        """Subtract biases of gyroscopes [rad/s] and accelerometers [m/s^2], and compute derivatives and covariance.

        Derivatives and covariance are those of a specific force f that stays as it is in the body, in the attitude M of
        the middle of the interval T: with C = -M hat(f), noise densities q of the gyroscopes and r of the
        accelerometers,

            d turn = -J T dbg,   d speed = -C T^2 / 2 dbg - M T dba,   d way = -C T^3 / 6 dbg - M T^2 / 2 dba

        J being the right Jacobian of the turn; and white noise n, m: turn' = n, speed' = C turn + M m, way' = speed.
        """
        last, time = self.increments, self.duration
        turned = so3.log(last.turn)
        middle = so3.exp(0.5 * turned)
        tipped = -middle @ so3.hat(middle.T @ last.speed / time)
        slopes = torch.zeros(9, 6).double()
        slopes[TURN, GYRO] = -time * so3.right_jacobian(turned)
        slopes[SPEED, GYRO], slopes[PLACE, GYRO] = -(time**2) / 2 * tipped, -(time**3) / 6 * tipped
        slopes[SPEED, ACCEL], slopes[PLACE, ACCEL] = -time * middle, -(time**2) / 2 * middle
        turn, speed, way = (slopes @ biases).unflatten(0, (3, 3))
        measured = Increments(
            last.turn @ so3.exp(turn), last.speed + speed, last.way + way, last.rate - biases[GYRO]
        )  # fmt: skip
        return Preintegrated(measured, unit.gyro**2 / self.tick, time, slopes, _white(tipped, time, unit))


def _white(tipped: Float[Tensor, "3 3"], time: float, unit: ImuConfig) -> Float[Tensor, "9 9"]:
    """Covariance of turn, speed and way by white noise in a time [s]; `tipped` is C."""
    q, r, eye, tips = unit.gyro**2, unit.accel**2, torch.eye(3).double(), tipped @ tipped.T
    turned, pushed, moved = q * time * eye, q * time**2 / 2 * tipped, q * time**3 / 6 * tipped
    speed = q * time**3 / 3 * tips + r * time * eye
    both = q * time**4 / 8 * tips + r * time**2 / 2 * eye
    way = q * time**5 / 20 * tips + r * time**3 / 3 * eye
    rows = ((turned, pushed.T, moved.T), (pushed, speed, both), (moved, both, way))
    return torch.cat([torch.cat(row, 1) for row in rows])
