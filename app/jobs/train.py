"""Train: gather photographs of a source, learn a field from them, store it."""

import math
from collections.abc import Generator
from dataclasses import asdict, replace
from pathlib import Path

import torch

import scenes
from app.jobs.events import JobEvent, JobEvents, JobResult, Progress
from app.jobs.train_neural import learn_networks
from app.jobs.training_data.gather import StoppedError, TrainingData, TrainRequest, gather
from app.storage.output_files import prepare_file
from nerfnav.errors import InvalidInputError
from nerfnav.experiments.freedom import (
    Freedom,
    freedom_alone,
    freedom_noted,
    freedom_on_depth,
    freedom_on_mesh,
    in_words,
)
from nerfnav.field.checkpoint import save_field
from nerfnav.field.neural import NeuralField
from nerfnav.field.train import TrainConfig, train
from nerfnav.field.voxel import VoxelField
from nerfnav.geometry.box import Box
from nerfnav.importers.meshes.truth import truth_beside, truth_path
from nerfnav.world.scene import Scene

MOST_VOXELS = 30_000_000
"""Training holds a dozen numbers for each voxel and thread."""
OUTSIDE_NODES = 128
"""Nodes along each edge of the grid over what photographs show around the box."""
SMOOTHNESS = (1e-8, 1e-7)
"""Weights of the roughness of densities and of colours for real photographs, which are few and differ in exposure."""

__all__ = ["StoppedError", "TrainRequest", "run"]


def run(request: TrainRequest) -> JobEvents:
    """Yield progress of every picture and reports of the training; return the numbers of the stored field.

    Send True to end early: what was learned so far is then stored and reported as usual.
    Raises NerfnavError where the source cannot be trained from or the file cannot be written.
    """
    out, gathering = prepare_file(request.out), gather(request)
    material = yield from gathering
    # the training's randomness is its own: it does not depend on how the photographs came about
    generator = torch.Generator().manual_seed(request.seed)
    if request.neural is None:
        config = _config(request, material)
        _require_room(material.box, config.voxel)
        trained = yield from _learn(material, config, generator)
    else:
        trained = yield from learn_networks(material, request, request.neural, generator)
    # the source is what later finds the ground truth again, so a capture must not go by a bundled scene's name
    name = material.truth.name if material.truth is not None else f"capture {Path(request.source).name}"
    told = replace(trained.info, source=name, seed=request.seed, guesses=material.guesses)
    trained = replace(trained, info=told)
    yield Progress("judging", 1.0)
    freedom = _freedom(trained, material)
    trained = replace(trained, info=freedom_noted(trained.info, freedom))
    file_bytes, files = _save(trained, material.truth, out)
    summary = {
        "psnr_db": trained.info.psnr_db,
        "train_s": trained.info.train_s,
        "voxels": math.prod(trained.shape) if isinstance(trained, VoxelField) else None,
        "file_bytes": file_bytes,
        "learned_from": trained.info.learned_from,
        "geometry": asdict(freedom),
        "in_words": in_words(freedom),
        "source": material.report,
    }
    return JobResult(summary, files)


def _freedom(trained: VoxelField | NeuralField, material: TrainingData) -> Freedom:
    """What planners take for free there, against the best that tells what is."""
    voxel = float(trained.spacing.max()) if isinstance(trained, VoxelField) else trained.step
    if material.truth is not None:
        seen_from = (material.learned.camera, material.learned.poses)
        return freedom_on_mesh(trained, voxel, material.truth, seen_from)
    if material.held_out.depth is not None and len(material.held_out):
        return freedom_on_depth(trained, voxel, material.held_out, material.learned)
    return freedom_alone(trained, voxel)


def _save(trained: VoxelField | NeuralField, truth: Scene | None, out: Path) -> tuple[int, tuple[Path, ...]]:
    """Store a field, and beside it the ground truth that is not bundled. Its size in bytes, and what was written."""
    if truth is None or truth.name in scenes.names():
        return save_field(trained, out), (out,)
    with truth_beside(truth, out) as link:
        linked = replace(trained, info=replace(trained.info, truth=link.name, truth_sha256=link.sha256))
        return save_field(linked, out), (out, truth_path(out))


def _config(request: TrainRequest, material: TrainingData) -> TrainConfig:
    config = request.config if material.bounded else _of_photographs(request.config)
    return replace(
        config,
        voxel=request.voxel or material.voxel or config.voxel,
        iterations=request.iterations or material.iterations or config.iterations,
        budget=request.budget,
    )


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


def _require_room(box: Box, voxel: float) -> None:
    if box.size.prod().item() / voxel**3 > MOST_VOXELS:
        raise InvalidInputError(
            f"a field of {box.describe()} with voxels of {voxel:g} m would have more than {MOST_VOXELS} of them: "
            "choose a larger --voxel"
        )


def _learn(
    material: TrainingData, config: TrainConfig, generator: torch.Generator
) -> Generator[JobEvent, bool | None, VoxelField]:
    steps = train(material.learned, material.held_out, material.box, material.background, config, generator)
    step = next(steps)
    while step.field is None:
        yield step
        stop = yield Progress("training", step.fraction)
        step = steps.send(stop)
    yield step
    return step.field
