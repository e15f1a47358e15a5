"""From posed images to a voxel field: Adam on the colour error of random rays, coarse to fine.

What makes it work: raw densities start low; the learning rate of a node's density is scaled by how many cameras see
it (without this, fog grows in front of the cameras); three resolutions; what is empty is skipped; thin fog costs.
For a seed, a number of iterations and a number of threads the result is the same bit for bit.
"""

import math
from collections.abc import Generator
from dataclasses import dataclass, replace

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.core.jit import default_threads, threads
from nerfnav.field.exposure_looks import ExposureLooks
from nerfnav.field.first_learner import first_learner
from nerfnav.field.judgement import info_of, judged
from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.proof.fusion import Fused
from nerfnav.field.seen_points import points_of
from nerfnav.field.train.config import TrainConfig
from nerfnav.field.train.exposure import corrected
from nerfnav.field.train.progress import Progress
from nerfnav.field.train.rays import RaySampler
from nerfnav.geometry import Box, PosedImages


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
    exposure, pictures = ExposureLooks(sampler, config.exposure), (photographs, held_out)
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
    told: Fused | None,
    pictures: tuple[PosedImages, PosedImages],
    sampler: RaySampler,
    training: tuple[Progress, TrainConfig, torch.Generator],
) -> VoxelField:
    """What was learned, with what the `pictures`, learned from and held out, say about it."""
    photographs, held_out = pictures
    progress, config, generator = training
    told_so_far = replace(field, info=info_of(photographs, generator, progress.iteration))
    if config.exposure:
        photographs = corrected(photographs, sampler.gains)
    trained = judged(told_so_far, told, photographs, held_out, config.exposure)
    return replace(trained, info=replace(trained.info, train_s=progress.elapsed_s))
