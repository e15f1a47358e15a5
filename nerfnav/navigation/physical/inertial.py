"""Inertial measurements, and states moved on by them; notation and equations are those of robots/strapdown.py."""

from dataclasses import dataclass, field

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.geometry import so3
from nerfnav.navigation.physical.config import PhysicalConfig
from nerfnav.navigation.physical.rigid_body import BodyState, rotation_of
from nerfnav.robots import Increments, Quadrotor, RigidState, advanced, moved_on


@dataclass
class InertialUnit:
    """Gyroscopes and accelerometers in the middle of the body, with white noise and biases that stay as they are."""

    config: PhysicalConfig
    """How good they are."""
    generator: torch.Generator
    """Decides their errors."""
    _bias: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        """Draw the biases."""
        std = np.repeat([self.config.gyroscope_bias_radps, self.config.accelerometer_bias_mps2], 3)
        self._bias = std * torch.randn(6, generator=self.generator, dtype=torch.float64).numpy()
        density = np.repeat([self.config.gyroscope_noise, self.config.accelerometer_noise], 3)
        self._white = density * self.config.control_hz**0.5

    def measure(self, body_rate: np.ndarray, specific_force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Angular velocity [rad/s] and specific force [m/s^2] as measured."""
        white = self._white * torch.randn(6, generator=self.generator, dtype=torch.float64).numpy()
        off = self._bias + white
        return body_rate + off[:3], specific_force + off[3:]


def mechanised(
    state: BodyState, measured: tuple[np.ndarray, np.ndarray], turning: np.ndarray, gravity: float, dt: float
) -> BodyState:
    """The state `dt` [s] later by a measured angular velocity [rad/s] and specific force [m/s^2] in the body.

    Gyroscopes measure the mean over that time, which is the angular velocity at its middle. At its end it is

        w = w_measured + dt / 2 w'

    up to the second order, with the angular acceleration w' (`turning` [rad/s^2]) that the rotors bring about.
    """
    body_rate, force = measured
    at = state.rotation, state.velocity, state.position
    turns = rotation_of(0.5 * dt * body_rate), rotation_of(dt * body_rate)
    rotation, velocity, position = advanced(at, turns, force, np.array([0.0, 0.0, -gravity]), dt)
    return BodyState(position, velocity, rotation, body_rate + 0.5 * dt * turning)


def increments(before: BodyState, after: BodyState, gravity: float, time: float) -> Float[Tensor, "12"]:
    """The action of Strapdown that leads from one state to another in a time [s]."""
    fall = np.array([0.0, 0.0, -gravity]) * time
    speed = before.rotation.T @ (after.velocity - before.velocity - fall)
    way = before.rotation.T @ (after.position - before.position - (before.velocity + 0.5 * fall) * time)
    turn = so3.log(torch.from_numpy(before.rotation.T @ after.rotation))
    return torch.cat([turn, *(torch.from_numpy(part) for part in (speed, way, after.body_rate))]).float()


class Strapdown(Quadrotor):
    """A quadrotor whose next state is known by what was measured on the way.

    Its action has 12 numbers: Log D [rad], dv [m/s] and dp [m] in the body as it was, and the last angular velocity
    [rad/s].
    """

    action_names = tuple(f"{part}_{axis}" for part in ("turn_rad", "dv_mps", "dp_m", "rate_radps") for axis in "xyz")

    def step(self, state: RigidState, action: Float[Tensor, "*batch 12"], dt: float) -> RigidState:
        """See above; `dt` [s] is the time that was measured."""
        turn, speed, way, rate = action.unflatten(-1, (4, 3)).unbind(-2)
        measured = Increments(so3.exp(turn), speed, way, rate + torch.zeros_like(state.body_rate))
        return moved_on(state, measured, action.new_tensor([0.0, 0.0, -self.config.gravity]), dt)
