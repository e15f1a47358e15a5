"""Inertial measurement unit of a tracked camera: its mount as given by the user, and its estimated biases."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry import Pose, so3
from nerfnav.tracking import FrameSource, InertialMotion
from nerfnav.tracking.frame import mount_of
from nerfnav.tracking.motions import CarrierMotion


@dataclass(frozen=True)
class GivenImu:
    """Use of the source's unit, with given data of it."""

    mount: tuple[float, ...] | None = None
    """T_imu_camera: x y z [m] and qx qy qz qw, the camera x right, y down, z ahead; None: as the source says."""

    def of(self, source: FrameSource, path: Path) -> tuple[InertialMotion, Pose]:
        """Motion model by the unit, and T_imu_camera. Raises InvalidInputError where the source lacks one of both."""
        inertial = source.inertial
        if inertial is None:
            raise InvalidInputError(
                f"{path} has no inertial measurements: --imu takes an MCAP or rosbag2 with sensor_msgs/Imu, or an "
                "EuRoC folder with imu0"
            )
        mount = inertial.mount if self.mount is None else _mount(self.mount)
        if mount is None:
            raise InvalidInputError(
                f"{path} does not say how the camera is mounted on its inertial measurement unit: give --imu-mount "
                "x y z qx qy qz qw (T_imu_camera, metres; the camera x right, y down, z ahead)"
            )
        return InertialMotion(inertial), mount


def describe_biases(motion: CarrierMotion) -> dict[str, Any]:
    """Estimated biases of a unit, for `track --json`."""
    if not isinstance(motion, InertialMotion):
        return {}
    if motion.last is None:
        return {"imu": "used, and nothing learned of its biases: the camera was not followed"}
    std = motion.last.covariance.diagonal().sqrt().tolist()
    biases = motion.last.biases.tolist()
    return {
        "gyro_bias_radps": biases[:3], "gyro_bias_std_radps": std[:3],
        "accel_bias_mps2": biases[3:], "accel_bias_std_mps2": std[3:6], "gravity_mps2": motion.last.gravity.tolist(),
    }  # fmt: skip


def _mount(numbers: tuple[float, ...]) -> Pose:
    position, (x, y, z, w) = numbers[:3], numbers[3:]
    length = float(np.linalg.norm((x, y, z, w)))
    if not (np.isfinite(numbers).all() and abs(length - 1) < 1e-2):
        raise InvalidInputError(f"the last four numbers of --imu-mount are a quaternion of length 1, not {length:g}")
    matrix = np.eye(4)
    turn = torch.tensor([w, x, y, z], dtype=torch.float64) / length
    matrix[:3, :3], matrix[:3, 3] = so3.matrix_from_quaternion(turn).numpy(), position
    return mount_of(matrix)
