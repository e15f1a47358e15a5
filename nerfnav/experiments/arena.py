"""Arena: a scene with its trained field, and the renderer, pictures and searcher that experiments share there.

Held-out views are pictures from poses that no field was trained from. Objects that take long to make are made once in
each process.
"""

from dataclasses import dataclass
from functools import lru_cache

import torch
from jaxtyping import UInt8
from torch import Tensor

from nerfnav.estimator import ColorNoise, GlobalLocalizer, RelocaliseConfig
from nerfnav.field import VoxelField
from nerfnav.geometry import FORWARD_MOUNT, Camera, Pose
from nerfnav.robots import CAMERA, RigidState
from nerfnav.world import CaptureConfig, MeshRenderer, Scene, capture_poses

SUPERSAMPLE = 2
"""Rays along each side of a pixel: as of the training photographs."""
_FIRST_SEED = 7001
"""Seed of random poses; bundled fields were photographed with small ones."""

per_arena = lru_cache(maxsize=2)
"""Decorator: cache the result of a function for the last two arenas."""


@dataclass(frozen=True, eq=False)
class Arena:
    """Arena: a scene and the field that was trained from it; plan on the field, judge on the scene."""

    scene: Scene
    """The ground truth."""
    field: VoxelField
    """Field trained from its pictures."""


def held_out_poses(arena: Arena, count: int, seed: int = 0) -> RigidState:
    """Robots at rest, batch shape (count,), at random free positions of the box, with something in view."""
    config = CaptureConfig(images=count, inside_share=1.0)
    cameras = capture_poses(arena.scene, config, torch.Generator().manual_seed(_FIRST_SEED + seed))
    zero = torch.zeros_like(cameras.position)
    return RigidState(cameras.position, zero, cameras.rotation @ FORWARD_MOUNT.rotation.T, zero)


@per_arena
def make_renderer(arena: Arena) -> MeshRenderer:
    """Renderer of the ground truth, as sharp as the training photographs."""
    return MeshRenderer(arena.scene, supersample=SUPERSAMPLE)


def take_picture(renderer: MeshRenderer, pose: Pose) -> UInt8[Tensor, "height width 3"]:
    """Render a robot's camera picture from T_world_body."""
    return renderer.render(CAMERA, pose.compose(FORWARD_MOUNT)).image


@per_arena
def make_searcher(arena: Arena, camera: Camera = CAMERA, noise: ColorNoise | None = None) -> GlobalLocalizer:
    """Make the searcher of the arena's field; the noise is by default that of the field."""
    info = arena.field.info
    config = RelocaliseConfig().for_field(info)
    return GlobalLocalizer(arena.field, camera, noise or ColorNoise().measured(info.noise_std), config)
