"""What cameras at some poses have: free space around them, and something to see."""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from nerfnav.geometry import Camera, Pose
from nerfnav.robots import Body, RigidState
from nerfnav.world.capture_config import CaptureConfig
from nerfnav.world.ground import ground
from nerfnav.world.raycast import MeshRenderer
from nerfnav.world.scene import Scene

_GLANCE = 20  # pixels along a picture that is only asked how much it shows


def is_free(scene: Scene, poses: Pose, clearance: float) -> Bool[Tensor, " n"]:
    """Whether a cube of half edge `clearance` [m] around each pose touches nothing."""
    edge = 2 * clearance
    cube = Body.box((edge, edge, edge), (1, 1, 1))
    level = torch.eye(3).expand_as(poses.rotation)
    still = torch.zeros_like(poses.position)
    return ~ground(scene).touches(cube, RigidState(poses.position, still, level, still))


def share_seen(renderer: MeshRenderer, poses: Pose, config: CaptureConfig) -> Float[Tensor, " n"]:
    """The share of each picture that is not sky, from a coarse glance."""
    camera = Camera.from_fov(config.width, config.height, config.horizontal_fov_deg)
    camera = camera.scaled(min(1.0, _GLANCE / config.width))
    shares = [renderer.render(camera, poses[k]).depth.isfinite().float().mean() for k in range(len(poses.position))]
    return torch.stack(shares) if shares else torch.zeros(0)
