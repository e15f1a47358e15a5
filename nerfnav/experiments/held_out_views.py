"""Held-out views: pictures from places that no field has learned from, with their true poses."""

from functools import lru_cache

import torch
from jaxtyping import UInt8
from torch import Tensor

from nerfnav.estimator import ColorNoise, GlobalLocalizer
from nerfnav.experiments.study import Arena
from nerfnav.geometry import FORWARD_MOUNT, Pose
from nerfnav.robots import CAMERA, RigidState
from nerfnav.world import CaptureConfig, MeshRenderer, capture_poses

SUPERSAMPLE = 2
"""Rays along each side of a pixel: as of those photographs."""
_FIRST_SEED = 7001
"""Of random places; bundled fields were photographed with small ones."""


def held_out_poses(arena: Arena, count: int, seed: int = 0) -> RigidState:
    """Robots at rest, batch shape (count,), at random free places of the box, looking anywhere but into nothing."""
    config = CaptureConfig(images=count, inside_share=1.0)
    cameras = capture_poses(arena.scene, config, torch.Generator().manual_seed(_FIRST_SEED + seed))
    zero = torch.zeros_like(cameras.position)
    return RigidState(cameras.position, zero, cameras.rotation @ FORWARD_MOUNT.rotation.T, zero)


def make_renderer(arena: Arena) -> MeshRenderer:
    """What takes pictures of the ground truth, as sharp as those photographs."""
    return MeshRenderer(arena.scene, supersample=SUPERSAMPLE)


def take_picture(renderer: MeshRenderer, pose: Pose) -> UInt8[Tensor, "height width 3"]:
    """What a robot's camera sees from T_world_body."""
    return renderer.render(CAMERA, pose.compose(FORWARD_MOUNT)).image


@lru_cache(maxsize=2)
def make_searcher(arena: Arena) -> GlobalLocalizer:
    """What finds a camera by one picture; made once in each process."""
    return GlobalLocalizer(arena.field, CAMERA, ColorNoise().measured(arena.field.info.noise_std))
