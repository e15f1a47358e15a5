"""Train job: gather photographs of a source, configure the training, learn a voxel field or networks, store it."""

import math
from collections.abc import Generator
from dataclasses import replace
from pathlib import Path

import torch

from nerfnav.core.deadline import Deadline
from nerfnav.core.errors import InvalidInputError
from nerfnav.core.steps import map_steps
from nerfnav.field import MlpConfig, NeuralField, NeuralTrainConfig, TrainConfig, TrainStep, VoxelField, train_neural
from nerfnav.field.models.neural import blank_field
from nerfnav.field.train.loop import train
from nerfnav.geometry import Box
from nerfnav_app.jobs.events import JobEvent, JobEvents, JobResult, Progress, relay_steps
from nerfnav_app.jobs.field.report import CALIBRATION, judge_field, noted, stored, training_numbers
from nerfnav_app.jobs.field.request import QUALITIES, NeuralOptions, Quality, TrainRequest, pixel_size, voxel_of
from nerfnav_app.jobs.field.training_data import TrainingData, gather
from nerfnav_app.storage.output_files import prepare_file

STORING = 0.03
"""Share of a budget for measuring the free-space accuracy and for storing the field."""
LEAST_TRAINING = 0.2
"""Share of a budget that training and evaluation have, however long the photographs take to read."""
EXCEEDED = 1.1
"""Times a budget, beyond which a training reports that it was too small."""
MOST_VOXELS = 30_000_000
"""Training holds a dozen numbers for each voxel and thread."""
OUTSIDE_NODES = 128
"""Nodes along each edge of the grid over what photographs show around the box."""
SMOOTHNESS = (1e-8, 1e-7)
"""Weights of the roughness of densities and of colours for real photographs, which are few and differ in exposure."""

CUT_OUT_RAYS = (1 / 8, 1 / 4, 1 / 2)
"""Shares of rays in the steps of each stage where pictures are cut out: their outlines tell the shape, and it takes
many steps, not many rays, to fill it in."""
CUT_OUT_PATCH = 2
"""Pixels along each edge of patches of rays there: twice as many rays are learned from in the same time."""
CUT_OUT_TIME = (0.08, 0.2, 0.72)
"""Share of each stage in the budget there: coarse grids have nothing more to learn soon."""


def config_for(request: TrainRequest, material: TrainingData) -> TrainConfig:
    config = request.config if material.bounded else _of_photographs(request.config)
    if material.learned.silhouettes is not None:
        config = replace(config, stage_rays=CUT_OUT_RAYS, stage_time=CUT_OUT_TIME, patch=CUT_OUT_PATCH)
    quality = QUALITIES[request.quality]
    return replace(
        config,
        voxel=request.voxel or _voxel(quality, material, config),
        iterations=request.iterations or round(quality.steps * (material.iterations or config.iterations)),
        budget=request.budget,
    )


def _voxel(quality: Quality, material: TrainingData, config: TrainConfig) -> float:
    """The voxel of a quality; what photographs of a real place tell apart, no quality makes finer."""
    suited = material.voxel or config.voxel
    pixel = pixel_size(material.learned, material.box) if material.bounded else suited
    finest = 1.001 * (material.box.size.prod().item() / MOST_VOXELS) ** (1 / 3)
    return voxel_of(quality, suited, max(pixel, finest))


def _of_photographs(config: TrainConfig) -> TrainConfig:
    """The same for photographs of a real place: what is around the box is learned too, and all of it more smoothly."""
    rough_density, rough_color = SMOOTHNESS
    return replace(
        config,
        outside=config.outside or OUTSIDE_NODES,
        exposure=True,
        rough_density=config.rough_density or rough_density,
        rough_color=config.rough_color or rough_color,
    )


def require_map_memory(source: str, box: Box, voxel: float) -> None:
    if box.size.prod().item() / voxel**3 > MOST_VOXELS:
        raise InvalidInputError(
            f"{source}: a field of {box.describe()} with voxels of {voxel:g} m would have more than {MOST_VOXELS} of "
            "them: choose a larger --voxel"
        )


def learn_voxels(
    material: TrainingData, config: TrainConfig, generator: torch.Generator, budget: Deadline | None = None
) -> Generator[JobEvent, bool | None, VoxelField]:
    """Yield reports and progress; return the field. Send True to end early. `config.budget` is a part of `budget`."""
    steps = train(material.learned, material.held_out, material.box, material.background, config, generator, budget)
    return relay_steps(
        steps,
        lambda step: (step,) if step.last else (step, Progress("training", step.fraction, step.seconds_left)),
    )


_LAYERS_BEFORE_SKIP = 5


def learn_networks(
    material: TrainingData, request: TrainRequest, options: NeuralOptions, generator: torch.Generator
) -> Generator[JobEvent, bool | None, NeuralField]:
    """Yield progress and return the field; send True to end early and keep what was learned.

    Raises InvalidInputError without the device that was asked for, or where photographs show more than the box.
    """
    if options.device.startswith("cuda") and not torch.cuda.is_available():
        raise InvalidInputError("there is no CUDA device here: train with --device cpu, and small networks")
    if not material.bounded:
        raise InvalidInputError(
            "these photographs show more than a box, and a neural field has nothing around its box: "
            "train a voxel field, which has"
        )
    skips = (_LAYERS_BEFORE_SKIP,) if options.layers > _LAYERS_BEFORE_SKIP + 1 else ()
    network = MlpConfig(options.layers, options.layer_width, skips, view_widths=(max(1, options.layer_width // 2),))
    asked = round(QUALITIES[request.quality].steps * NeuralTrainConfig.iterations)
    config = NeuralTrainConfig(network, request.iterations or asked, request.budget, rays=options.rays)
    blank = blank_field(material.box, material.background, network, generator, options.device)
    steps = train_neural(material.learned, material.held_out, blank, config, generator)
    return relay_steps(
        steps,
        lambda step: () if step.last else (Progress(f"training, PSNR {step.psnr_db:.1f} dB", step.fraction),),
    )


def run(request: TrainRequest, clock: Deadline | None = None) -> JobEvents:
    """Yield progress of every picture and reports of the training; return the numbers of the stored field.

    Send True to end early: what was learned so far is then stored and reported as usual. The budget of the request runs
    on `clock`, which may pause.
    Raises NerfnavError where the source cannot be trained from or the file cannot be written.
    """
    budget = Deadline(request.budget, clock)
    prepare_file(request.out)
    material = yield from gather(request)
    return (yield from learn(request, material, budget))


def learn(request: TrainRequest, material: TrainingData, budget: Deadline, made_by: str = "trained") -> JobEvents:
    """Train a field of photographs that were read within the budget, judge it and store it, as `run` does.

    Progress says how much of the budget is left.
    """
    return map_steps(_learn(request, material, budget, made_by), lambda event: _with_time_left(event, budget))


def _with_time_left(event: JobEvent, budget: Deadline) -> JobEvent:
    """The event with what is left of a budget; nothing is claimed once that is exceeded."""
    timed = isinstance(event, Progress) and math.isfinite(budget.seconds)
    return replace(event, left_s=budget.left_s if budget.left_s > 0 else None) if timed else event


def _learn(request: TrainRequest, material: TrainingData, budget: Deadline, made_by: str) -> JobEvents:
    out = request.out
    reading_s = budget.elapsed_s
    request = replace(request, budget=time_to_train(budget))
    # the training's randomness is its own: it does not depend on how the photographs came about
    generator = torch.Generator().manual_seed(request.seed)
    if request.neural is None:
        config = replace(config_for(request, material), field_every=request.save_every)
        require_map_memory(request.source, material.box, config.voxel)
        learning = learn_voxels(material, config, generator, budget)
        trained = yield from _keeping(learning, request, material, out)
    else:
        trained = yield from learn_networks(material, request, request.neural, generator)
    trained = noted(trained, request, material, made_by)
    training_s = budget.elapsed_s - reading_s
    trained, accuracy = yield from judge_field(trained, material, None if request.budget is None else budget)
    trained = trained.to("cpu")  # networks are judged on the device that they learned on
    file_bytes, files = stored(trained, material.truth, out)
    numbers = {**training_numbers(trained, accuracy, file_bytes), "source": material.report}
    if request.budget is not None:
        numbers["budget"] = describe_budget(budget, reading_s, training_s)
    return JobResult(numbers, files)


def time_to_train(budget: Deadline) -> float | None:
    """Time of a budget for training and its evaluation, once the photographs are read [s]; None without a budget."""
    if math.isinf(budget.seconds):
        return None
    return max(budget.left_s - (CALIBRATION + STORING) * budget.seconds, LEAST_TRAINING * budget.seconds)


def describe_budget(budget: Deadline, reading_s: float, training_s: float) -> dict[str, float | str]:
    """Describe how a budget was spent, for `--json`: `training_s` includes the evaluation."""
    took_s = budget.elapsed_s
    spent = {"reading_s": reading_s, "training_s": training_s, "judging_s": took_s - reading_s - training_s}
    numbers: dict[str, float | str] = {"asked_s": budget.seconds, "took_s": took_s, **spent}
    if took_s > EXCEEDED * budget.seconds:
        numbers["exceeded"] = (
            f"a budget of {budget.seconds:g} s is too small here for reading, proof of free space and calibration: "
            f"it took {took_s:.0f} s; give at least that, or a larger --voxel"
        )
    return numbers


def _keeping(
    learning: Generator[JobEvent, bool | None, VoxelField], request: TrainRequest, material: TrainingData, out: Path
) -> Generator[JobEvent, bool | None, VoxelField]:
    """The same training; what it has learned so far is stored in `out`, whole, whenever it tells."""

    def keep(event: JobEvent) -> JobEvent:
        if isinstance(event, TrainStep) and event.so_far is not None:
            stored(noted(event.so_far, request, material), material.truth, out)
        return event

    return map_steps(learning, keep)
