"""How alike two fields look."""

import torch

from nerfnav.field.core.protocol import Field
from nerfnav.field.render.volume_rendering import render_image
from nerfnav.geometry import (
    Box,
    Camera,
    Pose,
    look_at,
    psnr_db,
    spiral,
)


def sample_views(box: Box, views: int, distance: float) -> Pose:
    """Poses T_world_camera (views) spread around and above the box, looking at its middle.

    `distance` is that from the middle, in diagonals of the box.
    """
    towards = spiral((torch.arange(views) + 0.5) / views)
    return look_at(box.center + distance * box.size.norm() * towards, box.center.expand_as(towards))


def likeness(first: Field, second: Field, poses: Pose, camera: Camera) -> float:
    """Peak signal-to-noise ratio [dB] between what two fields show, over all pixels of all poses."""
    errors = [
        (render_image(first, camera, poses[index]).color.cpu() - render_image(second, camera, poses[index]).color)
        for index in range(len(poses.position))
    ]
    return psnr_db(torch.stack(errors).square().mean().item())
