"""Report of a new field: free-space accuracy, pose floor, stored files, ground truth, numbers for `--json`."""

import math
from collections.abc import Generator
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import torch

import nerfnav_scenes as scenes
from nerfnav.core.deadline import Deadline
from nerfnav.estimator import ColorNoise, calibrate_field, encode_views, measure_map_error
from nerfnav.experiments import (
    FreeSpaceAccuracy,
    describe_free_space_accuracy,
    measure_free_space_on_depth,
    measure_free_space_on_mesh,
    measure_unproven_share,
    note_free_space,
)
from nerfnav.field import NeuralField, StoredField, VoxelField, save_field
from nerfnav.importers import Placement
from nerfnav.importers.core.placement import Vector
from nerfnav.importers.meshes.ground_truth import truth_path, write_truth_beside
from nerfnav.world import Scene
from nerfnav_app.jobs.events import JobEvent, Progress
from nerfnav_app.jobs.field.training_data import TrainingData, TrainRequest

CALIBRATION = 0.1
"""Share of a budget for the calibration, at most."""
_FILTER = 0.75
"""Share of that for the filter, before the pose error of the pictures is measured."""


def import_numbers(made: StoredField) -> dict[str, Any]:
    return {
        "box": {"lower": made.box.lower.tolist(), "upper": made.box.upper.tolist()},
        **({"voxels": math.prod(made.shape)} if isinstance(made, VoxelField) else {}),
        "baked_psnr_db": made.info.baked_psnr_db,
        **accuracy_numbers(measure_unproven_share(made, made.resolution)),
    }


def accuracy_numbers(accuracy: FreeSpaceAccuracy) -> dict[str, Any]:
    """Free-space accuracy for `--json`, and in words."""
    return {"geometry": asdict(accuracy), "in_words": describe_free_space_accuracy(accuracy)}


def describe_placement(placement: Placement, up: Vector) -> dict[str, Any]:
    """Up and scale as they were taken, and which of them were guessed."""
    given = {"up": placement.up, "scale": placement.meters_per_unit, "box": placement.box}
    return {
        "up": list(placement.up or up),
        "meters_per_unit": placement.meters_per_unit or 1.0,
        "guessed": [name for name, value in given.items() if value is None],
    }


def judge_field(
    trained: VoxelField | NeuralField, material: TrainingData, budget: Deadline | None = None
) -> Generator[JobEvent, bool | None, tuple[VoxelField | NeuralField, FreeSpaceAccuracy]]:
    """Calibrate a field and measure its free-space accuracy; return the field with both, and the latter.

    Calibration takes a tenth of a budget, or less where less is left.
    """
    yield Progress("judging", 0.0)
    if isinstance(trained, VoxelField):
        trained = calibrated(trained, material, None if budget is None else budget.part(CALIBRATION * budget.seconds))
    yield Progress("judging", 0.5)
    return measure_accuracy(trained, material)


def measure_accuracy(
    trained: VoxelField | NeuralField, material: TrainingData
) -> tuple[VoxelField | NeuralField, FreeSpaceAccuracy]:
    """Measure the free-space accuracy of a field; return the field with it, and the accuracy."""
    accuracy = _accuracy_of(trained, material)
    return replace(trained, info=note_free_space(trained.info, accuracy)), accuracy


def _accuracy_of(trained: VoxelField | NeuralField, material: TrainingData) -> FreeSpaceAccuracy:
    """Free-space accuracy, against the best reference that there is."""
    voxel, learned = trained.resolution, material.learned
    if material.truth is not None:
        return measure_free_space_on_mesh(trained, voxel, material.truth, learned.camera, learned.poses)
    if material.held_out.depth is not None and len(material.held_out):
        return measure_free_space_on_depth(trained, voxel, material.held_out, learned)
    return measure_unproven_share(trained, voxel)


def calibrated(trained: VoxelField, material: TrainingData, until: Deadline | None = None) -> VoxelField:
    """Field with the calibration by held-out photographs, and of a capture with their pose error, for trackers.

    `until` limits the time of both.
    """
    info, alone = trained.info, material.truth is not None
    first = until if alone or until is None else until.part(_FILTER * until.seconds)
    if (found := calibrate_field(trained, info, material.held_out, until=first)) is not None:
        info = found.note_in(info)
    if alone:
        return replace(trained, info=info)
    noise = ColorNoise().measured(info.noise_std)
    floor = measure_map_error(trained, material.held_out, noise, torch.Generator().manual_seed(0), until)
    return replace(trained, info=replace(info, pose_floor=floor))


def stored(field: StoredField, truth: Scene | None, out: Path) -> tuple[int, tuple[Path, ...]]:
    """Store a field, and beside it the ground truth that is not bundled. Its size in bytes, and what was written."""
    if truth is None or truth.name in scenes.names():
        return save_field(field, out), (out,)
    with write_truth_beside(truth, out) as link:
        linked = replace(field, info=replace(field.info, truth=link.name, truth_sha256=link.sha256))  # type: ignore[type-var]
        return save_field(linked, out), (out, truth_path(out))


def training_numbers(trained: VoxelField | NeuralField, accuracy: FreeSpaceAccuracy, file_bytes: int) -> dict[str, Any]:
    """Numbers of a trained field for `train --json`."""
    keys = trained.info.input_keys
    return {
        "psnr_db": trained.info.psnr_db,
        "psnr_one_exposure_db": trained.info.psnr_one_exposure_db,
        "noise_std": trained.info.noise_std,
        "train_s": trained.info.train_s,
        "voxels": math.prod(trained.shape) if isinstance(trained, VoxelField) else None,
        "file_bytes": file_bytes,
        "learned_from": trained.info.learned_from,
        "proven_from": trained.info.proven_from,
        **accuracy_numbers(accuracy),
        **({} if keys is None else {"input_keys": asdict(keys)}),
    }


def noted(
    field: VoxelField | NeuralField, request: TrainRequest, material: TrainingData, made_by: str = "trained"
) -> VoxelField | NeuralField:
    """Note in the info of a field what it was made of."""
    # the source is what later finds the ground truth again, so a capture must not go by a bundled scene's name
    name = material.truth.name if material.truth is not None else f"capture {Path(request.source).name}"
    info = replace(
        field.info,
        source=name,
        made_by=made_by,
        seed=request.seed,
        guesses=material.guesses,
        camera=material.camera,
        placed=material.placed,
        input_keys=material.input_keys,
        views=() if material.truth is not None else encode_views(material.learned.poses),
    )
    return replace(field, info=info)
