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
from dataclasses import field as dataclass_field
from datetime import UTC, datetime

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.compiled import default_threads, threads
from nerfnav.field.calibration import calibrated
from nerfnav.field.carving import carved
from nerfnav.field.evidence import VOXELS_IN_UNIT, states_of
from nerfnav.field.exposure import gains
from nerfnav.field.fusion import Fused, fused
from nerfnav.field.info import FieldInfo
from nerfnav.field.learner import Finish, GridLearner, LearningRates, Place
from nerfnav.field.rays import RaySampler
from nerfnav.field.torch_learner import TorchLearner
from nerfnav.field.trainable import require_memory, require_trainable
from nerfnav.field.voxel import VoxelField
from nerfnav.geometry.box import Box
from nerfnav.geometry.grid import shape_for
from nerfnav.geometry.images import PosedImages, psnr_db

_FINISHING = 0.06
"""Share of a budget that goes into the unknown and the held-out views."""
_FORGET = 0.98
"""Share of the running error that a training step keeps."""


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
    rough_density: float = 0.0
    """Weight of the differences between raw densities of neighbours."""
    rough_color: float = 0.0
    """Weight of the differences between colours of neighbours."""
    stages: tuple[float, ...] = (4.0, 2.0, 1.0)
    """Distance of nodes in each stage, in final voxels."""
    stage_iterations: tuple[float, ...] = (0.4, 0.35, 0.25)
    """Share of each stage in the iterations. Coarse steps are cheap and move most."""
    stage_time: tuple[float, ...] = (0.12, 0.28, 0.6)
    """Share of each stage in the budget."""
    finish: Finish = dataclass_field(default_factory=Finish)
    """What becomes of the densities in the end."""
    outside: int = 0
    """Nodes along each edge of the grid over what is around the box, as photographs of real places need it; 0 where the
    background is one colour. See field/surroundings.py."""
    exposure: bool = False
    """Whether photographs may differ in exposure: their gains are then found between the stages."""
    device: str = "cpu"
    """Where to train: on "cpu" with compiled kernels, on "cuda" and others in torch, the same to rounding."""
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
    stop and keep it, send True: the next step is then the last. Raises InvalidInputError for images that no field can
    be learned from, and where memory cannot hold the training.
    """
    require_trainable(photographs, box)
    sampler = RaySampler(photographs, generator)
    begun = time.perf_counter()
    iteration, fraction, stage, error = 0, 0.0, 0, 0.0
    stop: bool | None = None
    ends = list(itertools.accumulate(config.stage_iterations if config.budget is None else config.stage_time))
    ends[-1] = math.inf  # whatever the shares add up to, the last stage lasts to the end
    finest = _shape(box, config, len(config.stages) - 1)
    with threads(default_threads()) as workers:
        require_memory(finest, config.outside, workers)
        told = None if photographs.depth is None else fused(photographs, box, finest)
        place = Place(box, background, VOXELS_IN_UNIT * config.voxel)
        if told is not None:  # where things are is known: there is nothing to find out coarsely first
            stage, learner = len(ends) - 1, _learner_of_depth(place, told, photographs, config, workers)
        else:
            learner = _learner(place, photographs, config, workers)
    while fraction < 1 and not stop:
        if fraction >= ends[stage]:
            stage += 1
            if config.exposure:
                sampler.correct(gains(learner.field(config.finish), photographs))
            learner = learner.refined(_shape(box, config, stage), _outside(config, stage))
        with threads(workers):
            loss = learner.step(sampler.draw(config.rays), _rates(config, fraction))
        error = loss if iteration == 0 else _FORGET * error + (1 - _FORGET) * loss
        iteration += 1
        elapsed = time.perf_counter() - begun
        fraction = min(1.0, iteration / config.iterations if config.budget is None else elapsed / _to_learn(config))
        if iteration % config.report_every == 0 and fraction < 1:
            left = elapsed * (1 - fraction) / fraction
            stop = yield TrainStep(iteration, fraction, psnr_db(error), iteration * config.rays / elapsed, left)
    rate = iteration * config.rays / (time.perf_counter() - begun)
    trained = _judged(learner.field(config.finish), told, photographs, held_out, iteration, generator)
    info = replace(trained.info, train_s=time.perf_counter() - begun)
    yield TrainStep(iteration, fraction, info.psnr_db or 0.0, rate, 0.0, replace(trained, info=info))


def _learner(place: Place, photographs: PosedImages, config: TrainConfig, workers: int) -> GridLearner | TorchLearner:
    """What learns the first stage: kernels on the processor, torch elsewhere."""
    learner = GridLearner.start(place, _shape(place.box, config, 0), photographs, workers, _outside(config, 0))
    return _on_device(learner, config)


def _learner_of_depth(
    place: Place, told: Fused, photographs: PosedImages, config: TrainConfig, workers: int
) -> GridLearner | TorchLearner:
    """The same where depths tell where things are."""
    return _on_device(GridLearner.from_depth(place, told, photographs, workers, config.outside), config)


def _on_device(learner: GridLearner, config: TrainConfig) -> GridLearner | TorchLearner:
    device = torch.device(config.device)
    return learner if device.type == "cpu" else TorchLearner.of(learner, device)


def _judged(
    field: VoxelField,
    told: Fused | None,
    photographs: PosedImages,
    held_out: PosedImages,
    iterations: int,
    generator: torch.Generator,
) -> VoxelField:
    """What was learned, with what is proven of its nodes and with what held-out views say about it."""
    free = carved(field, photographs) if told is None else told.free
    trained = replace(field, evidence=states_of(free, field.values[..., 0]))
    info = FieldInfo(
        learned_from="pictures" if told is None else "pictures and depth",
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        images=len(photographs),
        seed=generator.initial_seed(),
        iterations=iterations,
    )
    return replace(trained, info=calibrated(info, trained, held_out))


def _to_learn(config: TrainConfig) -> float:
    """Time until learning ends [s]; the rest of the budget is for what follows."""
    assert config.budget is not None
    return (1 - _FINISHING) * config.budget


def _rates(config: TrainConfig, fraction: float) -> LearningRates:
    decay = config.final_rate**fraction
    return LearningRates(
        config.density_rate * decay,
        config.color_rate * decay,
        config.sparsity,
        config.rough_density,
        config.rough_color,
    )


def _shape(box: Box, config: TrainConfig, stage: int) -> tuple[int, int, int]:
    return shape_for(box, config.voxel * config.stages[stage])


def _outside(config: TrainConfig, stage: int) -> int:
    return round(config.outside / config.stages[stage])
