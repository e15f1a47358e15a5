"""From posed images to a voxel field: Adam on the colour error of random rays, coarse to fine.

What makes it work: raw densities start low; the learning rate of a node's density is scaled by how many cameras see
it (without this, fog grows in front of the cameras); three resolutions; what is empty is skipped; thin fog costs.
For a seed, a number of iterations and a number of threads the result is the same bit for bit.
"""

import itertools
import math
import time
from collections.abc import Generator
from dataclasses import dataclass, replace
from datetime import UTC, datetime

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.compiled import default_threads, threads
from nerfnav.errors import InvalidInputError
from nerfnav.field.field import Field
from nerfnav.field.info import FieldInfo
from nerfnav.field.learner import GridLearner
from nerfnav.field.rays import RaySampler
from nerfnav.field.render import render_image
from nerfnav.field.voxel import VoxelField
from nerfnav.geometry.box import Box
from nerfnav.geometry.grid import shape_for
from nerfnav.geometry.images import PosedImages


@dataclass(frozen=True)
class TrainConfig:
    """How a voxel field is trained."""

    voxel: float = 0.013
    """Distance of nodes in the end [m]."""
    iterations: int = 1500
    """Training steps, when there is no budget."""
    budget: float | None = None
    """Time to spend [s]; replaces `iterations`. The result then depends on how fast the machine is."""
    rays: int = 8192
    """Rays in a training step."""
    density_rate: float = 0.25
    """Learning rate of raw densities at the start."""
    color_rate: float = 0.03
    """Learning rate of colours at the start."""
    final_rate: float = 0.1
    """What is left of the learning rates at the end."""
    sparsity: float = 1e-4
    """Weight of the integral of log(1 + 2 rho^2) along each ray: drives fog away."""
    stages: tuple[float, ...] = (4.0, 2.0, 1.0)
    """Distance of nodes in each stage, in final voxels."""
    stage_iterations: tuple[float, ...] = (0.4, 0.35, 0.25)
    """Share of each stage in the iterations. Coarse steps are cheap and move most."""
    stage_time: tuple[float, ...] = (0.12, 0.28, 0.6)
    """Share of each stage in the budget."""
    empty_below: float = 0.5
    """Density under which a node is emptied in the end [1/m]: 10 cm of it would stop 5 % of the light."""
    report_every: int = 50
    """Training steps between two TrainSteps."""


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
    stop and keep it, send True: the next step is then the last. Raises InvalidInputError when there is no image.
    """
    if len(photographs) == 0:
        raise InvalidInputError("there is no image to train from; at least two are needed")
    sampler = RaySampler(photographs, generator)
    begun = time.perf_counter()
    iteration, fraction, stage, error = 0, 0.0, 0, 0.0
    stop: bool | None = None
    ends = list(itertools.accumulate(config.stage_iterations if config.budget is None else config.stage_time))
    ends[-1] = math.inf  # whatever the shares add up to, the last stage lasts to the end
    with threads(default_threads()) as workers:
        learner = GridLearner.start(box, _shape(box, config, 0), background, photographs, workers)
    while fraction < 1 and not stop:
        if fraction >= ends[stage]:
            stage += 1
            learner = learner.refined(_shape(box, config, stage), photographs)
        decay = config.final_rate**fraction
        with threads(workers):
            loss = learner.step(
                sampler.draw(config.rays),
                config.density_rate * decay,
                config.color_rate * decay,
                config.sparsity,
            )
        error = loss if iteration == 0 else 0.98 * error + 0.02 * loss
        iteration += 1
        elapsed = time.perf_counter() - begun
        fraction = min(1.0, iteration / config.iterations if config.budget is None else elapsed / config.budget)
        if iteration % config.report_every == 0 and fraction < 1:
            left = elapsed * (1 - fraction) / fraction
            stop = yield TrainStep(iteration, fraction, _psnr(error), iteration * config.rays / elapsed, left)
    trained = learner.field(config.empty_below)
    info = FieldInfo(
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        images=len(photographs),
        train_s=time.perf_counter() - begun,
        seed=generator.initial_seed(),
        iterations=iteration,
    )
    rate = iteration * config.rays / info.train_s
    info, trained = _judged(replace(trained, info=info), held_out)
    yield TrainStep(iteration, fraction, info.psnr_db or 0.0, rate, 0.0, trained)


def residual(field: Field, photographs: PosedImages) -> Float[Tensor, "n height width 3"]:
    """Colour of the field minus colour of the photographs, in [-1, 1], for each pixel."""
    return torch.stack(
        [
            render_image(field, photographs.camera, photographs.poses[index]).color - image.float() / 255
            for index, image in enumerate(photographs.images)
        ]
    )


def _judged(field: VoxelField, held_out: PosedImages) -> tuple[FieldInfo, VoxelField]:
    """The field with its PSNR and measurement noise on views that it was not trained on."""
    if len(held_out) == 0:
        return field.info, field
    squared = residual(field, held_out).square()
    # PSNR as the literature has it: the mean over the images
    psnr = torch.stack([-10 * torch.log10(image.mean()) for image in squared]).mean()
    info = replace(field.info, psnr_db=float(psnr), noise_std=float(squared.mean().sqrt()))
    return info, replace(field, info=info)


def _shape(box: Box, config: TrainConfig, stage: int) -> tuple[int, int, int]:
    return shape_for(box, config.voxel * config.stages[stage])


def _psnr(mean_squared_error: float) -> float:
    return -10 * math.log10(max(mean_squared_error, 1e-10))
