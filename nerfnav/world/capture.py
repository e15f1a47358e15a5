"""Photographing a scene: where to stand, and what is seen from there.

Cameras stand in free space only: one inside a stone would teach a field that the stone is air.
"""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import torch

from nerfnav.geometry import Camera, Pose, PosedImages
from nerfnav.world.capture_config import CaptureConfig
from nerfnav.world.capture_poses import capture_poses
from nerfnav.world.raycast import MeshRenderer, Picture
from nerfnav.world.scene import Scene


@dataclass(frozen=True)
class CaptureStep:
    """One photograph."""

    index: int
    """Counted from 0."""
    total: int
    """How many there will be."""
    picture: Picture
    """The photograph."""
    pose: Pose
    """T_world_camera it was taken from."""
    captured: PosedImages | None = None
    """All photographs; set on the last step."""


def capture(scene: Scene, config: CaptureConfig, generator: torch.Generator) -> Iterator[CaptureStep]:
    """Photograph a scene, one step for each photograph; the last step carries all of them."""
    camera = Camera.from_fov(config.width, config.height, config.horizontal_fov_deg)
    renderer = MeshRenderer(scene, supersample=config.supersample)
    poses = capture_poses(scene, config, generator)
    images, depths = [], []
    for index in range(config.images):
        picture = renderer.render(camera, poses[index])
        images.append(picture.image)
        depths.append(picture.fine_depth)
        last = index + 1 == config.images
        captured = PosedImages(torch.stack(images), camera, poses, torch.stack(depths)) if last else None
        yield CaptureStep(index, config.images, picture, poses[index], captured)


def photograph(renderer: MeshRenderer, camera: Camera, poses: Pose) -> PosedImages:
    """The pictures taken from poses T_world_camera of batch shape (n,)."""
    pictures = [renderer.render(camera, poses[k]) for k in range(len(poses.position))]
    depth = torch.stack([picture.fine_depth for picture in pictures])
    return PosedImages(torch.stack([picture.image for picture in pictures]), camera, poses, depth)


def split(captured: PosedImages, every: int = 10) -> tuple[PosedImages, PosedImages]:
    """Images to learn from, and one of every `every` images, kept for testing: never learn from those."""
    test = list(range(every // 2, len(captured), every))
    train = sorted(set(range(len(captured))) - set(test))
    return captured.subset(train), captured.subset(test)


def images_taken(learned: int, every: int = 10) -> int:
    """How many photographs were taken, at least, where `split` left `learned` of them to learn from."""
    return next(count for count in itertools.count(learned) if count - len(range(every // 2, count, every)) == learned)
