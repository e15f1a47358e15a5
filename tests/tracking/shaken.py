"""A camera that is shaken before the test place, and the inertial measurement unit on it."""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.geometry import FORWARD_MOUNT, Pose, so3
from nerfnav.inertial import ImuConfig
from nerfnav.tracking import Frame, ImuMeasurements
from tests.tracking.walks import CAMERA, field, picture

IMU = ImuConfig()
MOUNT = Pose(so3.exp(torch.tensor([0.2, -0.1, 0.3])) @ FORWARD_MOUNT.rotation, torch.tensor([0.03, -0.02, 0.01]))
"""T_imu_camera."""
BIASES = torch.tensor([0.02, -0.03, 0.01, 0.15, -0.1, 0.1], dtype=torch.float64)
"""Of gyroscope [rad/s] and accelerometer [m/s^2]."""
_STEP = 1e-3


@dataclass(frozen=True)
class Shaken:
    """A camera before the balls, that sways and turns."""

    turning: float = 0.3
    """How far it turns to either side [rad] ..."""
    turns: float = 0.7
    """... so often in a second."""

    def pose(self, time: float) -> Pose:
        """T_world_camera, in double precision."""
        times = torch.tensor([time], dtype=torch.float64)
        return Pose(self._rotations(times)[0], self._positions(times)[0]).compose(_double(FORWARD_MOUNT))

    def frames(self, times: Sequence[float]) -> list[Frame]:
        """What is seen at these times [s]."""
        seen = [self.pose(time) for time in times]
        return [
            Frame(time, picture(field(), CAMERA, Pose(at.rotation.float(), at.position.float())), f"at {time:.3f}")
            for time, at in zip(times, seen, strict=True)
        ]

    def measured(self, end: float, seed: int | None = 0, rate: float = 200.0) -> ImuMeasurements:
        """What the unit says from -0.2 s on: with noise and biases, none of them without a seed."""
        times = torch.arange(-0.2, end, 1 / rate, dtype=torch.float64)
        before, here, after = (self._unit(times + offset) for offset in (-_STEP, 0.0, _STEP))
        rates = so3.local(before.rotation, after.rotation) / (2 * _STEP)
        pushed = (before.position - 2 * here.position + after.position) / _STEP**2
        up = torch.tensor([0.0, 0.0, IMU.gravity], dtype=torch.float64)
        forces = ((pushed + up)[:, None] @ here.rotation)[:, 0]
        if seed is not None:
            draws = torch.Generator().manual_seed(seed)
            rates = rates + BIASES[:3] + IMU.gyro * rate**0.5 * torch.randn(rates.shape, generator=draws).double()
            forces = forces + BIASES[3:] + IMU.accel * rate**0.5 * torch.randn(rates.shape, generator=draws).double()
        return ImuMeasurements(times, rates, forces, MOUNT)

    def _unit(self, times: Float[Tensor, " n"]) -> Pose:
        """T_world_imu."""
        back = MOUNT.rotation.double().T
        camera = _double(FORWARD_MOUNT).compose(Pose(back, -back @ MOUNT.position.double()))
        body = Pose(self._rotations(times), self._positions(times))
        return Pose(body.rotation @ camera.rotation, body.position + body.rotation @ camera.position)

    def _positions(self, times: Float[Tensor, " n"]) -> Float[Tensor, "n 3"]:
        angle = times[:, None] * torch.tensor([2.1, 2.9, 1.7]).double() + torch.tensor([0.2, 1.1, 2.0]).double()
        return torch.tensor([-0.35, 0.05, 0.28]).double() + torch.tensor([0.06, 0.1, 0.04]).double() * torch.sin(angle)

    def _rotations(self, times: Float[Tensor, " n"]) -> Float[Tensor, "n 3 3"]:
        yaw = self.turning * torch.sin(2 * torch.pi * self.turns * times)
        pitch = 0.3 * self.turning * torch.sin(2 * torch.pi * 1.3 * self.turns * times + 0.5)
        return so3.exp(torch.stack([torch.zeros_like(yaw), pitch, yaw], -1))


def _double(pose: Pose) -> Pose:
    return Pose(pose.rotation.double(), pose.position.double())
