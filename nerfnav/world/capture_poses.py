"""Poses from which photographs of a scene are taken."""

import math
from collections.abc import Callable

import torch

from nerfnav.errors import InvalidInputError
from nerfnav.geometry import R_BODY_CAMERA, Box, Pose, look_at, so3
from nerfnav.world.capture_config import CaptureConfig
from nerfnav.world.raycast import MeshRenderer, RayCaster
from nerfnav.world.scene import Scene, Vantage
from nerfnav.world.sight import is_free, share_seen
from nerfnav.world.vantage import suitable

_ROUNDS = 30
_TILT = 0.2
"""Standard deviation of the cameras' pitch and roll inside the box [rad]."""
_PAST_ENDS = 1.35
"""Cameras around the box stand up to so many half edges off its middle, at least."""
_NOWHERE = Pose(torch.zeros(0, 3, 3), torch.zeros(0, 3))


def capture_poses(scene: Scene, config: CaptureConfig, generator: torch.Generator) -> Pose:
    """Poses T_world_camera in free space, batch shape (images,), inside and around in shuffled order.

    Raises InvalidInputError where too few places are free and have something to see.
    """
    if config.images < 1:
        raise InvalidInputError(f"a capture needs at least 1 image, not {config.images}")
    share = 1.0 if scene.vantage is Vantage.INSIDE else config.inside_share  # nobody looks through walls
    inside = round(config.images * share)
    glance, caster = MeshRenderer(scene), RayCaster(scene.mesh)

    def pick(count: int, propose: Callable[[int], Pose]) -> Pose:
        """So many poses, or as many as were found in a few rounds."""
        kept = [_NOWHERE]
        for _ in range(_ROUNDS):
            missing = count - sum(len(pose.position) for pose in kept)
            if missing <= 0:
                break
            proposed = propose(2 * missing)
            free = proposed[is_free(scene, proposed, config.clearance)]
            free = free[suitable(caster, free.position, scene.vantage)]
            kept.append(free[share_seen(glance, free, config) >= config.seen_share])
        return Pose.cat(kept)[:count]

    poses = pick(inside, lambda count: _within(scene.box, config.flight_band, count, generator))
    if scene.vantage is not Vantage.INSIDE:  # where little of the box is free, more look in from around it
        missing = config.images - len(poses.position)
        poses = Pose.cat([poses, pick(missing, lambda count: _around(scene.box, count, generator))])
    if len(poses.position) < config.images:
        raise InvalidInputError(
            f"the scene {scene.name} has too few places for {config.images} cameras that are free within "
            f"{config.clearance:g} m and see the mesh in {config.seen_share:.0%} of their picture: ask for less"
        )
    return poses[torch.randperm(config.images, generator=generator)]


def _within(box: Box, band: tuple[float, float], count: int, generator: torch.Generator) -> Pose:
    """Cameras anywhere in the box, low ones more often, that look around as a tilting robot does."""
    share = torch.rand(count, 3, generator=generator)
    share[:, 2] = band[0] + (band[1] - band[0]) * share[:, 2] ** 1.6
    yaw = 2 * math.pi * torch.rand(count, generator=generator)
    pitch, roll = _TILT * torch.randn(2, count, generator=generator)
    zero = torch.zeros(count)
    tilt = so3.exp(torch.stack([zero, pitch, zero], -1)) @ so3.exp(torch.stack([roll, zero, zero], -1))
    return Pose(so3.from_yaw(yaw) @ tilt @ R_BODY_CAMERA, box.lower + share * box.size)


def _around(box: Box, count: int, generator: torch.Generator) -> Pose:
    """Cameras around and above the box that look at places in its middle."""
    share, aim = torch.rand(2, count, 3, generator=generator)
    yaw, elevation = 2 * math.pi * share[:, 0], torch.deg2rad(5 + 70 * share[:, 1] ** 1.5)
    way = torch.stack([elevation.cos() * yaw.cos(), elevation.cos() * yaw.sin(), elevation.sin()], -1)
    # the ball around the box's outline, drawn out where a long box would else hide its ends
    reach = torch.maximum(0.5 * box.size[:2].norm(), _PAST_ENDS * 0.5 * box.size) * (0.55 + 0.45 * share[:, 2:])
    return look_at(box.center + reach * way, box.center + (aim - 0.5) * 0.8 * box.size)
