"""Capture: photograph a scene from sampled camera poses in free space that have something to see.

Cameras stand in free space only: one inside a stone would teach a field that the stone is air.
"""

import itertools
import math
from collections.abc import Callable, Generator
from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry import R_BODY_CAMERA, Box, Camera, Pose, PosedImages, look_at, so3
from nerfnav.robots import Body, RigidState
from nerfnav.world.collision import ground
from nerfnav.world.raycast import MeshRenderer, Picture, RayCaster
from nerfnav.world.scene import Scene, Vantage
from nerfnav.world.vantage import filter_vantage

FINE_VOXEL = 0.017
"""Voxels up to this size [m] are those of places a few metres wide, the paper's scale."""


@dataclass(frozen=True)
class CaptureConfig:
    """Number, size and viewpoints of the photographs."""

    images: int = 200
    """Number of photographs."""
    width: int = 200
    """[pixels]"""
    height: int = 200
    """[pixels]"""
    horizontal_fov_deg: float = 90.0
    """Horizontal field of view [degrees]."""
    clearance: float = 0.05
    """Half edge of the cube around a camera that must be free [m]."""
    inside_share: float = 0.8
    """Share of cameras inside the box, where robots fly; the others look in from around it."""
    flight_band: tuple[float, float] = (0.1, 0.85)
    """Lowest and highest camera inside the box, as shares of its height; low ones are more frequent."""
    seen_share: float = 0.25
    """Smallest share of a photograph that must show the mesh and not the sky."""
    supersample: int = 2
    """Rays along each side of a pixel."""
    clear_voxels: float = 3.5
    """A camera keeps so many voxels from surfaces: a field of such voxels cannot resolve what is nearer."""

    def clear_of(self, voxel: float) -> "CaptureConfig":
        """The same for a place whose field has voxels of that size [m], small or large."""
        return replace(self, clearance=self.clear_voxels * voxel)

    def suiting(self, scene: Scene) -> "CaptureConfig":
        """The same for a bundled scene: cameras keep off surfaces by its voxels where those are large."""
        return self if scene.voxel is None or scene.voxel <= FINE_VOXEL else self.clear_of(scene.voxel)


def may_stand(
    scene: Scene, caster: RayCaster, positions: Float[Tensor, "n 3"], clearance: float
) -> Bool[Tensor, " n"]:
    """Mark positions [m] at which a camera may stand: nothing is within `clearance` [m], and its vantage is right."""
    level = torch.eye(3).expand(len(positions), 3, 3)
    free = is_free(scene, Pose(level, positions), clearance)
    free[free.clone()] = filter_vantage(caster, positions[free], scene.vantage)
    return free


_COARSE = 20  # pixels along the picture that measures the share that is seen


def is_free(scene: Scene, poses: Pose, clearance: float) -> Bool[Tensor, " n"]:
    """Mark poses around which a cube of half edge `clearance` [m] touches nothing."""
    cube = Body.box((2 * clearance, 2 * clearance, 2 * clearance), (1, 1, 1))
    level = torch.eye(3).expand_as(poses.rotation)
    still = torch.zeros_like(poses.position)
    return ~ground(scene).touches(cube, RigidState(poses.position, still, level, still))


def share_seen(renderer: MeshRenderer, poses: Pose, config: CaptureConfig) -> Float[Tensor, " n"]:
    """Share of each picture that is not sky, from a coarse picture."""
    full = Camera.from_fov(config.width, config.height, config.horizontal_fov_deg)
    camera = full.scaled(min(1.0, _COARSE / config.width))
    shares = [renderer.render(camera, poses[k]).depth.isfinite().float().mean() for k in range(len(poses.position))]
    return torch.stack(shares) if shares else torch.zeros(0)


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
    share = 1.0 if scene.vantage is Vantage.INSIDE else config.inside_share  # walls hide the inside from outside
    renderer, caster = MeshRenderer(scene), RayCaster(scene.mesh)

    def pick(count: int, propose: Callable[[int], Pose]) -> Pose:
        """So many poses, or as many as were found in a few rounds."""
        kept = [_NOWHERE]
        for _ in range(_ROUNDS):
            missing = count - sum(len(pose.position) for pose in kept)
            if missing <= 0:
                break
            proposed = propose(2 * missing)
            free = proposed[may_stand(scene, caster, proposed.position, config.clearance)]
            kept.append(free[share_seen(renderer, free, config) >= config.seen_share])
        return Pose.cat(kept)[:count]

    poses = pick(
        round(config.images * share), lambda count: _within(scene.box, config.flight_band, count, generator)
    )
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


@dataclass(frozen=True)
class CaptureStep:
    """Progress of a capture: one photograph."""

    index: int
    """Counted from 0."""
    total: int
    """Number of photographs in all."""
    picture: Picture
    """The photograph."""
    pose: Pose
    """T_world_camera it was taken from."""


def capture(
    scene: Scene, config: CaptureConfig, generator: torch.Generator
) -> Generator[CaptureStep, None, PosedImages]:
    """Photograph a scene, one step for each photograph, and return all of them."""
    camera = Camera.from_fov(config.width, config.height, config.horizontal_fov_deg)
    renderer = MeshRenderer(scene, supersample=config.supersample)
    poses = capture_poses(scene, config, generator)
    images, depths = [], []
    for index in range(config.images):
        picture = renderer.render(camera, poses[index])
        images.append(picture.image)
        depths.append(picture.fine_depth)
        yield CaptureStep(index, config.images, picture, poses[index])
    return PosedImages(torch.stack(images), camera, poses, torch.stack(depths))


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
    """Smallest number of photographs of which `split` leaves `learned` for training."""
    return next(count for count in itertools.count(learned) if count - len(range(every // 2, count, every)) == learned)
