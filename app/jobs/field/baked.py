"""Field baked from a mesh: made in seconds of the mesh itself, then calibrated by pictures, then trained on in colour.

Three stages, so that one can plan after the first, fly after the second, and see better after the third.
"""

from collections.abc import Generator
from dataclasses import replace
from pathlib import Path

import torch

from nerfnav.core.steps import map_steps
from nerfnav.field import VoxelField, calibrate_noise, save_field, train_colors
from nerfnav.importers import ImportedMesh, SceneConfig, SourceKind, bake_scene, source_kind, wrong_kind_error
from nerfnav.world import CaptureConfig, Scene, split
from nerfnav_app.jobs.events import JobEvent, JobEvents, JobResult, Progress
from nerfnav_app.jobs.field.bundled import images_for, photograph
from nerfnav_app.jobs.field.meshes import read_scene, volume_of
from nerfnav_app.jobs.field.report import calibrated, judge_field, measure_accuracy, stored, training_numbers
from nerfnav_app.jobs.field.request import QUALITIES, TrainRequest
from nerfnav_app.jobs.field.train import require_map_memory
from nerfnav_app.jobs.field.training_data import TrainingData
from nerfnav_app.places.sources import QualityName
from nerfnav_app.storage.output_files import prepare_file

_PICTURES = 20
"""Pictures that calibrate a baked field: noise of its colours, errors of poses."""


def bake(
    imported: ImportedMesh, quality: QualityName, seed: int, voxel: float | None = None
) -> Generator[JobEvent, bool | None, VoxelField]:
    """Yield progress, and return the field of a mesh, without noise and calibration yet.

    Raises InvalidInputError for too many voxels.
    """
    scene, guesses = imported.scene, imported.report["guesses"]
    assert scene.voxel is not None and isinstance(guesses, list), "an imported mesh has both"
    spacing = scene.voxel * QUALITIES[quality].nodes ** (-1 / 3) if voxel is None else voxel
    require_map_memory(scene.name, scene.box, spacing)
    steps = bake_scene(scene, spacing, _capture(spacing, _PICTURES))
    field = yield from map_steps(steps, lambda step: Progress(step.label, step.fraction))
    return replace(field, info=replace(field.info, source=scene.name, seed=seed, guesses=tuple(guesses)))


def calibrate(field: VoxelField, scene: Scene) -> Generator[JobEvent, bool | None, tuple[VoxelField, TrainingData]]:
    """Yield progress; return the field with its noise and calibration, and the pictures that they are of."""
    generator = torch.Generator().manual_seed(field.info.seed)
    pictures = yield from photograph(scene, _capture(field.resolution, _PICTURES), generator)
    yield Progress("calibrating", 0.0)
    field = replace(field, info=calibrate_noise(field.info, field, pictures))
    yield Progress("calibrating", 0.5)
    material = TrainingData(pictures, pictures, scene.box, field.background, scene, {})
    return calibrated(field, material), material


def learn_colors(field: VoxelField, scene: Scene, seconds: float) -> Generator[JobEvent, bool | None, VoxelField]:
    """Yield progress, and return a baked field with colours learned for so many seconds, judged by other pictures."""
    capture = _capture(field.resolution, images_for(volume_of(scene)))
    pictures = yield from photograph(scene, capture, torch.Generator().manual_seed(field.info.seed + 1))
    learned, held_out = split(pictures)
    steps = train_colors(field, learned, held_out, seconds, torch.Generator().manual_seed(field.info.seed))
    trained = yield from map_steps(steps, lambda step: Progress("learning colours", step.fraction))
    material = TrainingData(learned, held_out, scene.box, field.background, scene, {})
    judged, _ = yield from judge_field(trained, material)
    assert isinstance(judged, VoxelField), "a field stays of its kind"
    return judged


def refine(
    field: VoxelField, scene: Scene, file: Path, seconds: float
) -> Generator[JobEvent | VoxelField, None, None]:
    """Calibrate a baked field, where that was not done, and learn its colours; store each better field in its file.

    Yields progress, and each better field once.
    """
    if field.info.noise_std is None:
        field, _ = yield from calibrate(field, scene)
        save_field(field, file)
        yield field
    field = yield from learn_colors(field, scene, seconds)
    save_field(field, file)
    yield field


def run(request: TrainRequest) -> JobEvents:
    """Yield progress; return the numbers of the stored field of a mesh.

    Raises NerfnavError for other sources, and for options of training.
    """
    kind = source_kind(request.source)
    if kind is not SourceKind.MESH:
        raise wrong_kind_error(request.source, kind, "a mesh")
    request.require_unset(
        "a baked mesh",
        iterations=request.iterations,
        budget=request.budget,
        save_every=request.save_every,
        images=request.photographs.images,
        field=request.neural,
        depth=request.depth is not None,
    )
    out = prepare_file(request.out)
    imported = yield from read_scene(request, SceneConfig.nodes)
    field = yield from bake(imported, request.quality, request.seed, request.voxel)
    field, material = yield from calibrate(field, imported.scene)
    field, accuracy = measure_accuracy(field, material)
    file_bytes, files = stored(field, imported.scene, out)
    source = {**imported.report, "images_used": _PICTURES, "images_skipped": 0}
    return JobResult({**training_numbers(field, accuracy, file_bytes), "source": source}, files)


def _capture(voxel: float, images: int) -> CaptureConfig:
    return replace(CaptureConfig().clear_of(voxel), images=images)
