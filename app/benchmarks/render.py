"""A picture of the field: volume rendering in plain torch against the fused kernel, of the same rays.

The views and the threads, as many for torch as for kernels, are those of benchmarks/train_step.py, too.
"""

import torch
from torch import Tensor

from nerfnav.experiments import Arena
from nerfnav.field import Rendering, render_rays, uniform_samples
from nerfnav.geometry import Camera, look_at
from nerfnav_app.benchmarks.comparison import Comparison, both_threads, time_interleaved

THREADS = 2
"""Threads of compiled kernels and of torch, whose large tensors gain by them."""
_FOV_DEG = 90.0
_CAMERA_HEIGHT = 0.25
"""How high cameras stand in the box, as a share of its height."""
_RADIUS = 0.3
"""How far from the box's middle they stand, as a share of its edges."""


def rays_in(arena: Arena, count: int, size: int) -> tuple[Tensor, Tensor]:
    """Origins and directions of the rays of cameras of `size` x `size` pixels, on a ring in the box.

    They look across the middle of the box.
    """
    box, camera = arena.field.box, Camera.from_fov(size, size, _FOV_DEG)
    angles = torch.arange(count) * (2 * torch.pi / count)
    ring = torch.stack([angles.cos(), angles.sin(), torch.zeros(count)], -1)
    low = torch.tensor([0.0, 0.0, (_CAMERA_HEIGHT - 0.5)]) * box.size
    eyes = box.center + low + _RADIUS * box.size * ring
    origins, directions = zip(*(camera.rays(look_at(eye, box.center + low)) for eye in eyes), strict=True)
    return torch.cat(origins), torch.cat(directions)


_RAYS_AT_ONCE = 4096


def measure(arena: Arena, pictures: int = 3, size: int = 100, rounds: int = 1, fast_per_round: int = 5) -> Comparison:
    """Time both on pictures of `size` x `size` pixels, 90 degrees wide, taken from a ring in the arena.

    The times are those of all pictures. Torch renders all samples of each ray; what it takes when it is given, for
    free, those that the compiled search has found to matter, is `paper_given_samples_ms` in the detail, beside the
    largest difference of any colour (in [0, 1]) between torch with all samples and the kernel.
    """
    field = arena.field
    origins, directions = rays_in(arena, pictures, size)
    batches = list(zip(origins.split(_RAYS_AT_ONCE), directions.split(_RAYS_AT_ONCE), strict=True))

    @torch.no_grad()
    def slow() -> Tensor:
        return _colors([render_rays(field, *pair, uniform_samples(field.box, *pair, field.step)) for pair in batches])

    @torch.no_grad()
    def given() -> Tensor:
        return _colors([render_rays(field, *pair, found) for pair, found in zip(batches, samples, strict=True)])

    def fast() -> Tensor:
        return _colors([field.render_rays(*pair) for pair in batches])

    with both_threads(THREADS):
        samples = [field.samples(*pair) for pair in batches]
        slow_ms, fast_ms, expected, seen = time_interleaved(slow, fast, rounds, fast_per_round)
        given_ms, *_ = time_interleaved(given, fast, rounds)
    detail = {
        "max_color_difference": (expected - seen).abs().max().item(),
        "paper_given_samples_ms": given_ms,
        "rays": float(len(origins)),
        "torch_threads": float(THREADS),
    }
    return Comparison("render", slow_ms, fast_ms, THREADS, detail)


def _colors(parts: list[Rendering]) -> Tensor:
    return torch.cat([part.color for part in parts])
