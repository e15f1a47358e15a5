"""Pictures along a way through the test place of three balls."""

from collections.abc import Sequence
from functools import cache

import torch
from jaxtyping import UInt8
from torch import Tensor

from nerfnav.field import VoxelField
from nerfnav.field.render.volume_rendering import render_image
from nerfnav.geometry import FORWARD_MOUNT, Camera, Pose
from nerfnav.robots import RigidState
from nerfnav.tracking import Frame
from tests.estimator.places import voxel_balls

CAMERA = Camera.from_fov(120, 96, 80)
DT = 1 / 15
field = cache(voxel_balls)


def pose(seconds: float) -> Pose:
    """T_world_camera of a hand that goes 0.2 m/s and turns."""
    state = RigidState.at_rest((-0.42 + 0.2 * seconds, 0.05 + 0.05 * seconds, 0.28), 0.1 - 0.15 * seconds)
    return state.pose.compose(FORWARD_MOUNT)


def picture(place: VoxelField, camera: Camera, at: Pose) -> UInt8[Tensor, "height width 3"]:
    """What is seen there."""
    color = render_image(place, camera, at).color
    return (255 * color.clamp(0, 1)).round().to(torch.uint8).reshape(camera.height, camera.width, 3)


def walk(times: Sequence[float], camera: Camera = CAMERA) -> list[Frame]:
    """Frames at these times [s]."""
    return [Frame(time, picture(field(), camera, pose(time)), f"at {time:.3f}") for time in times]


def every(count: int, dt: float = DT, first: float = 0.0) -> list[float]:
    """Times of so many frames."""
    return [first + dt * index for index in range(count)]
