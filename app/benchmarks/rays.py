"""What render and train_step are timed on: views in an arena, and as many threads for torch as for kernels."""

from collections.abc import Iterator
from contextlib import contextmanager

import torch

from nerfnav.compiled import threads
from nerfnav.experiments import Arena
from nerfnav.geometry import Camera, Pose, look_at

THREADS = 2
"""Threads of compiled kernels and of torch, whose large tensors gain by them."""
_FOV_DEG = 90.0
_CAMERA_HEIGHT = 0.25
"""How high cameras stand in the box, as a share of its height."""
_RADIUS = 0.3
"""How far from the box's middle they stand, as a share of its edges."""


@contextmanager
def field_threads() -> Iterator[None]:
    """Give kernels and torch the same number of threads inside the block."""
    with threads(THREADS):  # which gives torch its own number back
        torch.set_num_threads(THREADS)
        yield


def views_in(arena: Arena, count: int, size: int) -> list[tuple[Camera, Pose]]:
    """Cameras of `size` x `size` pixels on a ring in the box, at poses T_world_camera, that look across its middle."""
    box, camera = arena.field.box, Camera.from_fov(size, size, _FOV_DEG)
    angles = torch.arange(count) * (2 * torch.pi / count)
    ring = torch.stack([angles.cos(), angles.sin(), torch.zeros(count)], -1)
    low = torch.tensor([0.0, 0.0, (_CAMERA_HEIGHT - 0.5)]) * box.size
    eyes = box.center + low + _RADIUS * box.size * ring
    return [(camera, look_at(eye, box.center + low)) for eye in eyes]
