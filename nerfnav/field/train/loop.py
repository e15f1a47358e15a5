"""Training loop of voxel fields: Adam on the colour error of random rays of posed images, coarse to fine.

What makes it work: raw densities start low; the learning rate of a node's density is scaled by how many cameras see
it (without this, fog grows in front of the cameras); three resolutions; what is empty is skipped; thin fog costs.
For a seed, a number of iterations and a number of threads the result is the same bit for bit.

Photographs and the machine's memory are checked before training begins. Depth maps and silhouettes, where there are
any, say what is known before the first stage.
"""


import math
from collections.abc import Generator
from dataclasses import dataclass, replace
from typing import NamedTuple

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from nerfnav.core import memory
from nerfnav.core.errors import InvalidInputError
from nerfnav.core.jit import default_threads, threads
from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.proof.fusion import FusedDepth, fuse_depth
from nerfnav.field.proof.visual_hull import compute_hull, widen_silhouettes
from nerfnav.field.train.config import TrainConfig
from nerfnav.field.train.evaluation import describe_training, evaluate_grid
from nerfnav.field.train.exposure import ExposureCorrection, correct_exposure
from nerfnav.field.train.grid_learner import GridLearner
from nerfnav.field.train.progress import Progress
from nerfnav.field.train.rays import RaySampler, points_of
from nerfnav.field.train.torch_learner import TorchLearner
from nerfnav.field.train.trained_grid import training_bytes
from nerfnav.field.train.training_volume import Place
from nerfnav.geometry import Box, PosedImages

_LEAST_IMAGES = 2
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


def require_memory(shape: tuple[int, int, int], outside: int, workers: int) -> None:
    """Raise InvalidInputError where the machine's free memory cannot hold the training of grids of these sizes."""
    nx, ny, nz = shape
    needed = training_bytes(nx * ny * nz, workers) + training_bytes(outside**3, workers)
    memory.require_memory(needed, f"training {nx} x {ny} x {nz} nodes", "choose a larger voxel")


class FirstLearner(NamedTuple):
    """Where training begins."""

    learner: GridLearner | TorchLearner
    """Kernels on the processor, torch elsewhere."""
    stage: int
    """The stage that it is for."""
    told: FusedDepth | None
    """What depths tell of where things are; None without depths."""
    asked: Bool[Tensor, "n height width"] | None = None
    """Which pixels there is something to learn from; None: all."""


def first_learner(
    photographs: PosedImages, box: Box, background: torch.Tensor, config: TrainConfig, workers: int
) -> FirstLearner:
    """What learns at first, on `workers` threads.

    Raises InvalidInputError for images that no field can be learned from, and where memory cannot hold the training.
    """
    require_trainable(photographs, box)
    last = len(config.stages) - 1
    require_memory(config.shape(box, last), config.outside, workers)
    place = Place.of(box, background, config.voxel)
    if photographs.silhouettes is not None:
        shape = config.shape(box, 0)
        wide = widen_silhouettes(photographs, box, config.voxel * config.stages[0])
        learner = GridLearner.in_hull(place, compute_hull(wide, box, shape), photographs, workers)
        return FirstLearner(_on_device(learner, config), 0, None, wide.silhouettes)
    if photographs.depth is None:
        shape, outside = config.shape(box, 0), config.nodes_outside(0)
        learner = GridLearner.start(place, shape, photographs, workers, outside)
        return FirstLearner(_on_device(learner, config), 0, None)
    # where things are is known: there is nothing to find out coarsely first
    told = fuse_depth(photographs, box, config.shape(box, last))
    learner = GridLearner.from_depth(place, told, photographs, workers, config.outside)
    return FirstLearner(_on_device(learner, config), last, told)


def _on_device(learner: GridLearner, config: TrainConfig) -> GridLearner | TorchLearner:
    device = torch.device(config.device)
    return learner if device.type == "cpu" else TorchLearner.of(learner, device)


@dataclass(frozen=True)
class TrainStep:
    """Where training stands."""

    iteration: int
    """Training steps done."""
    fraction: float
    """Share of the training that is done, 0 to 1."""
    psnr_db: float
    """Peak signal-to-noise ratio [dB]: of recent training rays; on the last step, of held-out views."""
    rays_per_s: float
    """Rays learned from in a second, since the start."""
    seconds_left: float
    """Estimated time to the end [s]."""
    field: VoxelField | None = None
    """The trained field; set on the last step."""
    so_far: VoxelField | None = None
    """What is learned so far, judged as the trained field is, so that one can plan in it: set every `field_every` s."""

    @staticmethod
    def of(progress: Progress) -> "TrainStep":
        """A step before the last."""
        now = (progress.iteration, progress.fraction, progress.psnr_db)
        return TrainStep(*now, progress.rays_per_s, progress.seconds_left)


def train(
    photographs: PosedImages,
    held_out: PosedImages,
    box: Box,
    background: Float[Tensor, "3"],
    config: TrainConfig,
    generator: torch.Generator,
) -> Generator[TrainStep, bool | None, None]:
    """Train a voxel field in `box` and yield progress; the last step carries the field.

    `background` is the colour of rays that nothing stops. Closing the generator early loses what was learned; to
    stop and keep it, send True: the next step is then the last. Raises InvalidInputError for images that no field can
    be learned from, and where memory cannot hold the training.
    """
    progress = Progress(config.iterations, config.seconds_to_learn)
    with threads(default_threads()) as workers:
        learner, stage, told, asked = first_learner(photographs, box, background, config, workers)
    sampler, ends = RaySampler(photographs, generator, asked), config.stage_ends
    points = points_of(photographs, box, generator)
    exposure, pictures = ExposureCorrection(sampler, config.exposure), (photographs, held_out)
    stop: bool | None = None
    next_field_s = config.field_every or math.inf
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
        if progress.elapsed_s >= next_field_s and progress.fraction < 1:
            seen = _judged(learner.so_far(config.finish), told, pictures, sampler, (progress, config, generator))
            next_field_s = progress.elapsed_s + (config.field_every or math.inf)
            stop = yield replace(TrainStep.of(progress), so_far=seen)
        elif progress.is_due(config.report_every):
            stop = yield TrainStep.of(progress)
    rate = progress.rays_per_s
    trained = _judged(learner.field(config.finish), told, pictures, sampler, (progress, config, generator))
    yield TrainStep(progress.iteration, progress.fraction, trained.info.psnr_db or 0.0, rate, 0.0, trained)


def _judged(
    field: VoxelField,
    told: FusedDepth | None,
    pictures: tuple[PosedImages, PosedImages],
    sampler: RaySampler,
    training: tuple[Progress, TrainConfig, torch.Generator],
) -> VoxelField:
    """What was learned, with what the `pictures`, learned from and held out, say about it."""
    photographs, held_out = pictures
    progress, config, generator = training
    told_so_far = replace(field, info=describe_training(photographs, generator, progress.iteration))
    if config.exposure:
        photographs = correct_exposure(photographs, sampler.gains)
    trained = evaluate_grid(told_so_far, told, photographs, held_out, config.exposure)
    return replace(trained, info=replace(trained.info, train_s=progress.elapsed_s))
