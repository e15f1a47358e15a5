"""Training loop of voxel fields: Adam on the colour error of random rays of posed images, coarse to fine.

What makes it work: raw densities start low; the learning rate of a node's density is scaled by how many cameras see
it (without this, fog grows in front of the cameras); three resolutions; empty space is skipped; thin fog costs.
For a seed, a number of iterations and a number of threads the result is the same bit for bit.

Photographs and the machine's memory are checked before training begins. Depth maps and silhouettes, where there are
any, give the geometry before the first stage.
"""

import math
from collections.abc import Generator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Bool, Float, UInt8
from torch import Tensor

from nerfnav.core.deadline import Deadline
from nerfnav.core.errors import InvalidInputError
from nerfnav.core.jit import default_threads, threads
from nerfnav.core.memory import require_memory
from nerfnav.field.core.occupancy import VOXELS_IN_UNIT
from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.proof.fusion import FusedDepth, fuse_depth
from nerfnav.field.proof.visual_hull import compute_hull, widen_silhouettes
from nerfnav.field.train.config import TrainConfig
from nerfnav.field.train.evaluation import describe_training, evaluate_grid, predict_cost
from nerfnav.field.train.exposure import ExposureCorrection, correct_exposure
from nerfnav.field.train.grid_learner import GridLearner
from nerfnav.field.train.progress import Progress, TrainStep
from nerfnav.field.train.rays import RaySampler, points_of
from nerfnav.field.train.torch_learner import TorchLearner
from nerfnav.field.train.trained_grid import training_bytes
from nerfnav.field.train.training_volume import TrainingVolume
from nerfnav.geometry import Box, PosedImages

_LEAST_IMAGES = 2
_PICTURE = 320
"""Longest side of pictures of the field in training [pixels]."""
_ORTHONORMAL = 1e-2  # how far a rotation times its transpose may be from the identity


def require_trainable(photographs: PosedImages, box: Box) -> None:
    """Raise InvalidInputError, in one sentence, for photographs that no field can be learned from."""
    count, rotation, position = len(photographs), photographs.poses.rotation, photographs.poses.position
    if count < _LEAST_IMAGES:
        raise InvalidInputError(
            f"{count or 'no'} image{'s' if count != 1 else ''} cannot show where things are: at least {_LEAST_IMAGES}, "
            "better a hundred, from different places are needed"
        )
    if not (box.size > 0).all() or not box.size.isfinite().all():
        raise InvalidInputError(f"the box {box.describe()} is empty: its upper corner must lie above its lower one")
    finite = rotation.isfinite().flatten(1).all(1) & position.isfinite().all(1)
    if not finite.all():
        raise InvalidInputError(f"the pose of image {int((~finite).nonzero()[0])} is not finite: leave that image out")
    gram = (rotation @ rotation.transpose(-1, -2) - rotation.new_ones(3).diag()).abs().flatten(1).amax(1)
    turned = (gram > _ORTHONORMAL) | (rotation.det() < 0)
    if turned.any():
        raise InvalidInputError(f"the pose of image {int(turned.nonzero()[0])} is no rotation: leave that image out")


class FirstLearner(NamedTuple):
    """Learner, stage and known geometry at the start of training."""

    learner: GridLearner | TorchLearner
    """Kernels on the processor, torch elsewhere."""
    stage: int
    """The stage that it is for."""
    depth: FusedDepth | None
    """Geometry fused from depth maps; None without depth."""
    mask: Bool[Tensor, "n height width"] | None = None
    """Mask of the pixels that are drawn; None: all."""


def first_learner(
    photographs: PosedImages, box: Box, background: torch.Tensor, config: TrainConfig, workers: int
) -> FirstLearner:
    """Make the learner of the first stage, on `workers` threads.

    Raises InvalidInputError for images that no field can be learned from, and where memory cannot hold the training.
    """
    require_trainable(photographs, box)
    last = len(config.stages) - 1
    nx, ny, nz = config.shape(box, last)
    needed = training_bytes(nx * ny * nz, workers) + training_bytes(config.outside**3, workers)
    require_memory(needed, f"training {nx} x {ny} x {nz} nodes", "choose a larger voxel")
    place = TrainingVolume(box, background, VOXELS_IN_UNIT * config.voxel)
    if photographs.silhouettes is not None:
        shape = config.shape(box, 0)
        wide = widen_silhouettes(photographs, box, config.voxel * config.stages[0])
        learner = GridLearner.in_hull(place, compute_hull(wide, box, shape), photographs, workers)
        return FirstLearner(_on_device(learner, config), 0, None, wide.silhouettes)
    if photographs.depth is None:
        shape, outside = config.shape(box, 0), config.nodes_outside(0)
        learner = GridLearner.start(place, shape, photographs, workers, outside)
        return FirstLearner(_on_device(learner, config), 0, None)
    # the geometry is known: coarse stages would find nothing
    depth = fuse_depth(photographs, box, (nx, ny, nz))
    learner = GridLearner.from_depth(place, depth, photographs, workers, config.outside)
    return FirstLearner(_on_device(learner, config), last, depth)


def _on_device(learner: GridLearner, config: TrainConfig) -> GridLearner | TorchLearner:
    device = torch.device(config.device)
    return learner if device.type == "cpu" else TorchLearner.of(learner, device)


def _picture(learner: GridLearner | TorchLearner, sampler: RaySampler) -> UInt8[np.ndarray, "height width 3"]:
    """Render the field so far from the first photograph, in some hundredths of a second."""
    rays, (rows, columns) = sampler.draw_view(0, _PICTURE)
    return (255 * learner.colors(rays).numpy()).clip(0, 255).round().astype(np.uint8).reshape(rows, columns, 3)


def train(
    photographs: PosedImages,
    held_out: PosedImages,
    box: Box,
    background: Float[Tensor, "3"],
    config: TrainConfig,
    generator: torch.Generator,
    budget: Deadline | None = None,
) -> Generator[TrainStep, bool | None, VoxelField]:
    """Train a voxel field in `box`, yield progress, and return the field.

    `background` is the colour of rays that nothing stops. `config.budget` runs on the clock of `budget`, where that is
    given, which may pause. No iterations give the field as it begins: of depth maps, what they show. Closing the
    generator early loses what was learned; to stop and keep it, send True: the next step is then the last. Raises
    InvalidInputError for images that no field can be learned from, and where memory cannot hold the training.
    """
    budget = Deadline(config.budget, budget)
    progress, cost = Progress(config.iterations, budget, config.least_iterations), None
    with threads(default_threads()) as workers:
        learner, stage, depth, mask = first_learner(photographs, box, background, config, workers)
    sampler, ends = RaySampler(photographs, generator, mask), config.stage_ends
    points = points_of(photographs, box, generator)
    exposure = ExposureCorrection(sampler, config.exposure)

    def evaluate(field: VoxelField) -> VoxelField:
        """Return a field in training with its occupancy and its quality."""
        field = replace(field, info=describe_training(photographs, generator, progress.iteration))
        shown = correct_exposure(photographs, sampler.gains) if config.exposure else photographs
        carving = budget.part(budget.left_s - (0.0 if cost is None else cost.noise_s))
        trained = evaluate_grid(field, depth, shown, held_out, config.exposure, carving)
        return replace(trained, info=replace(trained.info, train_s=progress.elapsed_s))

    stop: bool | None = None
    next_field_s, next_picture_s = config.field_every or math.inf, 0.0 if config.picture_every else math.inf
    while progress.fraction < 1 and not stop:
        if progress.fraction >= ends[stage]:
            stage += 1
            learner = learner.refined(config.shape(box, stage), config.nodes_outside(stage))
        if progress.fraction >= config.firm_at:
            learner.firm(config.finish)
        exposure.look(learner, progress.fraction)
        with threads(workers):
            batch = sampler.draw(config.rays_of(stage), config.patch)
            ended = None if points is None else points.draw(config.points)
            progress.learned(learner.step(batch, config.rates(progress.fraction), ended), len(batch.targets))
        if progress.has_budget and cost is None and stage == len(config.stages) - 1:
            cost = predict_cost(learner.so_far(config.finish), depth, photographs, held_out)
            progress.reserve(cost.total_s)
        if progress.elapsed_s >= next_field_s and progress.fraction < 1:
            so_far = evaluate(learner.so_far(config.finish))
            next_field_s = progress.elapsed_s + (config.field_every or math.inf)
            stop = yield replace(progress.step(), so_far=so_far)
        elif progress.elapsed_s > next_picture_s:
            with threads(workers):
                picture = _picture(learner, sampler)
            next_picture_s = progress.elapsed_s + (config.picture_every or math.inf)
            stop = yield replace(progress.step(), picture=picture)
        elif progress.is_due(config.report_every):
            stop = yield progress.step()
    rate = progress.rays_per_s
    trained = evaluate(learner.field(config.finish))
    yield progress.last_step(trained.info.psnr_db or 0.0, rate)
    return trained
