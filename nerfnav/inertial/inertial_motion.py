"""Inertial motion: between two pictures an inertial measurement unit predicts, an extension of the paper's filter.

The paper predicts by the robot's dynamics and the action that it took (Eqs. 3-4). Here gyroscope and accelerometer
take their place (preintegrated.py), and their unknown constants are part of the state: the biases bg and ba, and
gravity g, for the z axis of a field of photographs is only about vertical, b = (bg, ba, g). With R, v and p
preintegrated over the time T between the pictures,

    R' = R0 R,   v' = v0 + g T + R0 v,   p' = p0 + v0 T + g T^2 / 2 + R0 p,   w' = w_last - bg

A picture determines the pose, not b. That follows by its regression on the state, which loses nothing, for the picture
depends on b through the state alone:

    K = Sigma_bx Sigma_xx^-1,   b+ = b + K (x+ (-) x-),   Sigma_bb+ = Sigma_bb - K (Sigma_xx - Sigma_xx+) K'

The state's body is the unit itself, so that the camera's mount is T_imu_camera; the world is z-up, in metres.
"""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.estimator import Belief
from nerfnav.geometry import so3
from nerfnav.inertial.imu import ImuConfig
from nerfnav.inertial.preintegrated import GYRO, PLACE, SPEED, TURN, Preintegrated
from nerfnav.inertial.strapdown import propagate_state
from nerfnav.robots import ATTITUDE, BODY_RATE, POSITION, TANGENT, VELOCITY

CONSTANTS = 9
_BIASES, _GRAVITY = slice(0, 6), slice(6, 9)


@dataclass(frozen=True)
class InertialBelief:
    """Joint belief of the state and of what hardly changes: biases and gravity."""

    belief: Belief
    """The state."""
    constants: Float[Tensor, "9"]
    """Biases of gyroscope [rad/s] and accelerometer [m/s^2], and gravity in the field's axes [m/s^2]."""
    covariance: Float[Tensor, "9 9"]
    """Covariance of the constants."""
    cross: Float[Tensor, "9 12"]
    """Cross-covariance of constants and state."""

    @classmethod
    def begin(cls, belief: Belief, config: ImuConfig) -> "InertialBelief":
        """Begin with constants of their usual size."""
        sizes = [config.gyro_bias] * 3 + [config.accel_bias] * 3 + [config.gravity_std] * 3
        constants = torch.zeros(CONSTANTS).double()
        constants[-1] = -config.gravity
        std = torch.tensor(sizes, dtype=torch.float64)
        return cls(belief, constants, torch.diag(std.square()), torch.zeros(CONSTANTS, TANGENT).double())

    def restart_with(self, belief: Belief) -> "InertialBelief":
        """Restart with a state that comes from elsewhere; the belief of the constants stays."""
        return replace(self, belief=belief, cross=torch.zeros_like(self.cross))

    @property
    def biases(self) -> Float[Tensor, "6"]:
        """Biases of gyroscope [rad/s] and accelerometer [m/s^2]."""
        return self.constants[_BIASES]

    @property
    def gravity(self) -> Float[Tensor, "3"]:
        """Gravity in the field's axes [m/s^2]."""
        return self.constants[_GRAVITY]

    def corrected(self, posterior: Belief, before: Belief | None = None) -> "InertialBelief":
        """Correct the constants by regression, after a picture has corrected the state.

        `before` is the prediction that the picture corrected, where that was not `belief` but a wider one.
        """
        before = self.belief if before is None else before
        spread, after = before.covariance.double(), posterior.covariance.double()
        gain = torch.linalg.solve(spread, self.cross.T).T
        change = before.mean.local(posterior.mean).double()
        covariance = self.covariance - gain @ (spread - after) @ gain.T
        return InertialBelief(
            posterior, self.constants + gain @ change, 0.5 * (covariance + covariance.T), gain @ after
        )  # fmt: skip


def predict(last: InertialBelief, measured: Preintegrated, config: ImuConfig) -> tuple[InertialBelief, Tensor]:
    """Predict over measurements; returns also the part of the covariance that their noise adds."""
    mean, covariance = last.belief.mean.to(torch.float64), last.belief.covariance.double()
    time, turned = measured.duration, mean.rotation
    after = propagate_state(mean, measured.increments, last.gravity, time)
    by_state, by_measured = _slopes(turned, measured)
    by_constants = torch.zeros(TANGENT, CONSTANTS).double()
    by_constants[:, _BIASES] = by_measured @ measured.by_biases
    by_constants[BODY_RATE, GYRO] = -torch.eye(3).double()
    by_constants[VELOCITY, _GRAVITY] = time * torch.eye(3).double()
    by_constants[POSITION, _GRAVITY] = 0.5 * time**2 * torch.eye(3).double()
    noise = by_measured @ measured.covariance @ by_measured.T
    noise[BODY_RATE, BODY_RATE] = measured.rate_variance * torch.eye(3).double()
    both = by_state @ last.cross.T @ by_constants.T
    known = by_constants @ last.covariance @ by_constants.T
    spread = by_state @ covariance @ by_state.T + both + both.T + known + noise
    cross = last.cross @ by_state.T + last.covariance @ by_constants.T
    walk = torch.tensor([config.gyro_walk**2] * 3 + [config.accel_walk**2] * 3 + [0.0] * 3, dtype=torch.float64)
    kinds = last.belief.mean.position.dtype, last.belief.covariance
    belief = Belief(after.to(kinds[0]), (0.5 * (spread + spread.T)).to(kinds[1]))
    return replace(last, belief=belief, cross=cross, covariance=last.covariance + torch.diag(walk * time)), noise


def _slopes(turned: Tensor, measured: Preintegrated) -> tuple[Float[Tensor, "12 12"], Float[Tensor, "12 9"]]:
    """Derivatives of the predicted state by the one before and by what was measured; `turned` is R0."""
    by_state, by_measured = torch.zeros(TANGENT, TANGENT).double(), torch.zeros(TANGENT, 9).double()
    eye, increments = torch.eye(3).double(), measured.increments
    by_state[POSITION, POSITION] = by_state[VELOCITY, VELOCITY] = eye
    by_state[POSITION, VELOCITY] = measured.duration * eye
    by_state[POSITION, ATTITUDE] = -turned @ so3.hat(increments.way)
    by_state[VELOCITY, ATTITUDE] = -turned @ so3.hat(increments.speed)
    by_state[ATTITUDE, ATTITUDE] = increments.turn.T
    by_measured[POSITION, PLACE] = by_measured[VELOCITY, SPEED] = turned
    by_measured[ATTITUDE, TURN] = eye
    return by_state, by_measured
