"""Georeference job (`nerfnav place`): correct scale, floor and box of a field by hand, without training again.

Splats and ground truth beside the field are corrected with it; splats are made into voxels again.
"""

from collections.abc import Generator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor

import nerfnav_scenes as scenes
from nerfnav.core.errors import InvalidInputError
from nerfnav.core.steps import map_steps
from nerfnav.estimator import rescale_map_error, transform_views
from nerfnav.experiments import measure_unproven_share
from nerfnav.field import (
    FieldInfo,
    GridField,
    StoredField,
    VoxelField,
    crop_field,
    intersect_boxes,
    load_field,
    move_field,
    surface_points,
)
from nerfnav.geometry import Similarity
from nerfnav.importers import (
    Alignment,
    AlignmentRequest,
    Splats,
    VoxelizeConfig,
    compute_alignment,
    drop_answered_guesses,
    load_splats,
    save_splats,
    splats_path,
    voxelize,
)
from nerfnav.world import Scene, move_scene
from nerfnav_app.jobs.events import JobEvent, JobEvents, JobResult, Progress
from nerfnav_app.jobs.field.report import accuracy_numbers, stored
from nerfnav_app.places.place import field_file, ground_truth
from nerfnav_app.storage.output_files import OutputError, prepare_file


def numbers_of(field: StoredField, changes: tuple[str, ...]) -> dict[str, Any]:
    """Numbers of a georeferenced field, and what has changed, in words."""
    return {
        "box": {"lower": field.box.lower.tolist(), "upper": field.box.upper.tolist()},
        "voxel_m": field.resolution,
        "changed": list(changes),
        "guesses": list(field.info.guesses),
        **accuracy_numbers(measure_unproven_share(field, field.resolution)),
    }


def moved_field(field: StoredField, change: Alignment) -> Generator[JobEvent, bool | None, StoredField]:
    moved = yield from map_steps(
        move_field(field, change.similarity), lambda step: Progress(step.label, 0.1 + 0.8 * step.fraction)
    )
    return moved if change.box is None else crop_field(moved, change.box)


def placed_splats(splats: Splats, change: Alignment) -> Splats:
    """Splats where they belong: nothing of them is lost."""
    similarity = change.similarity
    placed = splats.to_world(similarity.rotation.numpy(), similarity.scale)
    return replace(placed, centers=(placed.centers + similarity.translation.numpy()).astype("float32"))


def voxels_of(splats: Splats, field: StoredField, change: Alignment) -> VoxelField:
    """Voxels of splats, as fine as before."""
    box = change.similarity.box(field.box)
    if change.box is not None:
        box = intersect_boxes(change.box, box)
    voxel = change.similarity.scale * (float(field.spacing.min()) if isinstance(field, GridField) else field.step)
    return voxelize(splats, VoxelizeConfig(voxel=voxel, box=box), field.info.source)


def truth_of(
    field: StoredField, path: Path, change: Alignment, changed: StoredField
) -> tuple[Scene | None, tuple[str, ...]]:
    """The ground truth where it belongs, and what to say of it."""
    truth = ground_truth(field, path)
    if truth is None:
        return None, ()
    if field.info.source in scenes.names():
        return None, (f"the ground truth and the tasks of {field.info.source} stay behind: plans are not judged there",)
    return move_scene(truth.load(), change.similarity, changed.box), ("its ground truth goes along",)


def info_of(
    changed: StoredField, before: FieldInfo, correction: AlignmentRequest, similarity: Similarity
) -> FieldInfo:
    """Update the info: figures about surfaces hold as upper bounds, those of free space no more."""
    return replace(
        changed.info,
        # the name of a scene would find ground truth that is not there
        source=f"{before.source} (placed)" if before.source in scenes.names() else before.source,
        truth="",
        truth_sha256="",
        free_taken_for_free=None,
        surface_taken_for_free=before.surface_taken_for_free,
        unproven_share=measure_unproven_share(changed, 0.0).unproven_share,
        guesses=drop_answered_guesses(before.guesses, correction.answered),
        placed=similarity.after(Similarity.of_numbers(before.placed)).numbers if before.placed else (),
        views=transform_views(before.views, similarity),
        position_floor_m=None if before.position_floor_m is None else similarity.scale * before.position_floor_m,
        pose_floor=rescale_map_error(before.pose_floor, similarity.scale),
    )


_ALONG = 160
"""Points along the longest edge at which surfaces are looked for."""
_UP = (0.0, 0.0, 1.0)


def find_surface(field: StoredField, correction: AlignmentRequest) -> Float[Tensor, "n 3"]:
    """Find points on the surface of a field [m], in its own coordinates, among which a floor may be."""
    up = torch.tensor(correction.up or _UP, dtype=torch.float64)
    x, y, z = (up if correction.moved is None else correction.moved.rotation.T @ up).tolist()
    return surface_points(field, float(field.box.size.max()) / _ALONG, (x, y, z))


@dataclass(frozen=True)
class PlaceRequest:
    """Request of a georeferencing: the field, its correction, a new file."""

    what: str
    """Path of a field file, or name of a bundled scene."""
    correction: AlignmentRequest
    """Measurements, and points on the floor."""
    out: Path
    """The file for the field, another one than that which it is made of."""


def run(request: PlaceRequest) -> JobEvents:
    """Yield progress, and return what has changed and what was guessed.

    Splats beside the field are corrected and made into voxels again; ground truth beside it is corrected too.
    Raises NerfnavError where nothing is asked for, or it cannot be done.
    """
    correction = request.correction
    if correction.is_empty:
        raise InvalidInputError("nothing is to be changed: give --turn, --measure, --scale, --floor, --up or --box")
    path = field_file(request.what)
    out = prepare_file(request.out)
    if out.exists() and out.samefile(path):
        raise OutputError(f"{out} is the field itself: choose another file, so that you can go back to this one")
    field = load_field(path)
    yield Progress("looking for surfaces", 0.05)
    points = find_surface(field, correction)
    change = compute_alignment(correction, field.box, points, torch.Generator().manual_seed(0))
    beside = splats_path(path)
    splats = placed_splats(load_splats(beside), change) if beside.is_file() else None
    changed = (yield from moved_field(field, change)) if splats is None else voxels_of(splats, field, change)
    truth, of_truth = truth_of(field, path, change, changed)
    kept = () if change.box is None else (f"what is kept: {changed.box.describe()}",)
    changed = replace(changed, info=info_of(changed, field.info, correction, change.similarity))  # type: ignore[type-var]
    yield Progress("storing the field", 0.95)
    file_bytes, files = stored(changed, truth, out)
    if splats is not None:
        files = (*files, save_splats(splats, splats_path(out)))
    numbers = numbers_of(changed, (*change.changes, *kept, *of_truth))
    return JobResult({**numbers, "file_bytes": file_bytes}, files)
