"""Colour training: learn the colours of a field whose geometry is known, such as one baked from a mesh."""

import time
from collections.abc import Generator
from dataclasses import replace

import torch

from nerfnav.core.jit import default_threads, threads
from nerfnav.core.memory import require_memory
from nerfnav.field.core.occupancy import VOXELS_IN_UNIT
from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.train.evaluation import calibrate_noise
from nerfnav.field.train.grid_learner import GridLearner, LearningRates
from nerfnav.field.train.progress import TrainStep
from nerfnav.field.train.rays import RaySampler
from nerfnav.field.train.trained_grid import training_bytes
from nerfnav.geometry import PosedImages, psnr_db

_RATE, _FINAL = 0.01, 0.1
"""Adam's learning rate of colours at the start, and the share of it that is left at the end: 0.03 first forgets what
the baked colours show."""
_RAYS = 8192
"""Rays in a step."""


def train_colors(
    field: VoxelField, photographs: PosedImages, held_out: PosedImages, seconds: float, generator: torch.Generator
) -> Generator[TrainStep, None, VoxelField]:
    """Yield each step, and return the field with learned colours and its noise on held-out photographs.

    Densities and occupancy stay as they are. Time counts while a step is computed, not between two steps. Raises
    InvalidInputError where memory cannot hold the training.
    """
    nx, ny, nz = field.shape
    with threads(default_threads()) as workers:
        needed = training_bytes(nx * ny * nz, workers)
        require_memory(needed, f"training {nx} x {ny} x {nz} nodes", "choose a larger voxel")
        learner = GridLearner.of(field, VOXELS_IN_UNIT * field.resolution, workers)
    sampler, spent, fraction, iterations = RaySampler(photographs, generator), 0.0, 0.0, 0
    while fraction < 1:
        begun = time.perf_counter()
        with threads(workers):
            rates = LearningRates(0.0, _RATE * _FINAL**fraction, 0.0)
            error = learner.step(sampler.draw(_RAYS), rates)
        # in the first step, kernels may be compiled
        spent += time.perf_counter() - begun if iterations else 0.0
        iterations, fraction = iterations + 1, min(1.0, spent / seconds)
        speed = (iterations - 1) * _RAYS / max(spent, 1e-9)
        yield TrainStep(iterations, fraction, psnr_db(error), speed, seconds - spent)
    values = field.values.clone()
    values[..., 1:] = learner.inner.released()[..., 1:]
    info = replace(field.info, images=len(photographs), iterations=iterations, train_s=spent)
    trained = replace(field, values=values)
    return replace(trained, info=calibrate_noise(info, trained, held_out))
