"""What a robot sees with, as its file describes it.

    camera: {position: [0.1, 0, 0.05], pitch: 0.2, width: 200, height: 200, fov: 90}
    camera: {file: camera.yaml, pitch: -0.3}      # a calibration, see geometry/camera_file.py

The camera stands at `position` [m] in the body's axes and looks ahead, `pitch` [rad] downwards; `fov` is its horizontal
field of view [degrees].
"""

import math
from pathlib import Path

import msgspec
import torch

from nerfnav.errors import InvalidInputError
from nerfnav.geometry import FORWARD_MOUNT, Camera, Pose, read_camera, so3
from nerfnav.robots.body_file import Vector
from nerfnav.robots.robot import CAMERA, Robot


class CameraFile(msgspec.Struct, forbid_unknown_fields=True):
    """What `camera` may hold in a robot's file."""

    position: Vector = (0.0, 0.0, 0.0)
    pitch: float = 0.0
    width: int | None = None
    height: int | None = None
    fov: float = 90.0
    file: str | None = None


def seen_with(robot: Robot, told: CameraFile | None, folder: Path) -> Robot:
    """The robot with the camera of its file, which lies in `folder`. Raises InvalidInputError if it is none."""
    return robot if told is None else robot.with_camera(_camera_of(told, folder), mount_of(told.position, told.pitch))


def mount_of(position: Vector, pitch: float) -> Pose:
    """T_body_camera of a camera at `position` [m] in the body that looks ahead, `pitch` [rad] downwards."""
    if not all(map(math.isfinite, position)) or not abs(pitch) <= math.pi / 2:
        raise InvalidInputError(
            f"a camera looks at most pi/2 = 1.57 rad downwards or upwards, not {pitch:g}, from a finite position"
        )
    downwards = so3.exp(torch.tensor([0.0, pitch, 0.0]))
    return Pose(downwards @ FORWARD_MOUNT.rotation, torch.tensor(position))


def _camera_of(told: CameraFile, folder: Path) -> Camera:
    if told.file is not None:
        if (told.width, told.height) != (None, None):
            raise InvalidInputError("a camera's size is in its calibration: leave out width and height beside `file`")
        return read_camera(folder / told.file)
    return Camera.from_fov(told.width or CAMERA.width, told.height or CAMERA.height, told.fov)
