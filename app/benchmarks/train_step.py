"""A training step: gradient by autograd and Adam in plain torch against the fused kernels, from the same state."""

import numpy as np
import torch

from nerfnav.experiments import Arena
from nerfnav.field import GridLearner, LearningRates, RayBatch, TorchLearner, TrainConfig
from nerfnav.field.core.occupancy import VOXELS_IN_UNIT
from nerfnav_app.benchmarks.comparison import Comparison, both_threads, time_interleaved
from nerfnav_app.benchmarks.render import THREADS, rays_in

_VIEWS, _SIZE = 8, 64


def measure(arena: Arena, rays: int = 1024, rounds: int = 3, fast_per_round: int = 5) -> Comparison:
    """Time both on a batch of rays through the trained field, all of whose nodes learn on.

    Torch skips what is empty as the kernels do. The detail has the gradients' largest difference relative to the
    largest gradient, for both from the same state, and the relative difference of the errors.
    """
    batch = _batch(arena, rays)
    config = TrainConfig()
    rates = LearningRates(1e-4, 1e-4, config.sparsity)  # small: the state stays what it is
    with both_threads(THREADS):
        fast = GridLearner.of(arena.field, VOXELS_IN_UNIT * 2 * arena.field.step, THREADS)
        slow = TorchLearner.of(fast, torch.device("cpu"))
        error, gradient = fast.gradient(batch, config.sparsity), fast.inner.dense_gradient()
        fast.inner.forget()
        torch_error, (torch_gradient, *_) = slow.gradient(batch, config.sparsity)
        detail = {
            "max_gradient_difference": float((gradient - torch_gradient).abs().max() / gradient.abs().max()),
            "error_difference": abs(error / torch_error - 1),
            "rays": float(rays),
            "torch_threads": float(THREADS),
        }
        slow.step(batch, rates)  # warm; so is the fast one before it is timed
        slow_ms, fast_ms, *_ = time_interleaved(
            lambda: slow.step(batch, rates), lambda: fast.step(batch, rates), rounds, fast_per_round
        )
    return Comparison("train_step", slow_ms, fast_ms, THREADS, detail)


def _batch(arena: Arena, count: int) -> RayBatch:
    """Rays of random pixels of views in the arena, with random colours to learn."""
    origins, directions = rays_in(arena, _VIEWS, _SIZE)
    generator = torch.Generator().manual_seed(0)
    chosen = torch.randperm(len(origins), generator=generator)[:count]
    targets = torch.rand(len(chosen), 3, generator=generator)
    jitter = np.zeros(len(chosen), np.float32)
    return RayBatch(origins[chosen].numpy(), directions[chosen].numpy(), targets.numpy(), jitter)
