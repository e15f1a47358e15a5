"""What becomes of a field, its splats and its ground truth when it is put right."""

from collections.abc import Generator
from dataclasses import replace
from pathlib import Path

import nerfnav_scenes as scenes
from nerfnav.estimator import rescaled, views_moved
from nerfnav.experiments import freedom_alone
from nerfnav.field import FieldInfo, MoveStep, StoredField, VoxelField, cropped, moved, overlap
from nerfnav.geometry import Similarity
from nerfnav.importers import Corrected, Correction, Splats, VoxelizeConfig, still_guessed, voxelize
from nerfnav.world import Scene, moved_scene
from nerfnav_app.jobs.events import JobEvent, Progress
from nerfnav_app.places.place import ground_truth


def moved_field(field: StoredField, change: Corrected) -> Generator[JobEvent, bool | None, StoredField]:
    step: MoveStep | None = None
    for step in moved(field, change.similarity):
        yield Progress(step.label, 0.1 + 0.8 * step.fraction)
    assert step is not None and step.field is not None, "moving ends with its field"
    return step.field if change.box is None else cropped(step.field, change.box)


def placed_splats(splats: Splats, change: Corrected) -> Splats:
    """Splats where they belong: nothing of them is lost."""
    similarity = change.similarity
    placed = splats.placed(similarity.rotation.numpy(), similarity.scale)
    return replace(placed, centers=(placed.centers + similarity.translation.numpy()).astype("float32"))


def voxels_of(splats: Splats, field: StoredField, change: Corrected) -> VoxelField:
    """Voxels of splats, as fine as before."""
    box = change.similarity.box(field.box)
    if change.box is not None:
        box = overlap(change.box, box)
    voxel = change.similarity.scale * (float(field.spacing.min()) if isinstance(field, VoxelField) else field.step)
    return voxelize(splats, VoxelizeConfig(voxel=voxel, box=box), field.info.source)


def truth_of(
    field: StoredField, path: Path, change: Corrected, changed: StoredField
) -> tuple[Scene | None, tuple[str, ...]]:
    """The ground truth where it belongs, and what to say of it."""
    truth = ground_truth(field, path)
    if truth is None:
        return None, ()
    if field.info.source in scenes.names():
        return None, (f"the ground truth and the tasks of {field.info.source} stay behind: plans are not judged there",)
    return moved_scene(truth.load(), change.similarity, changed.box), ("its ground truth goes along",)


def cut_in_words(change: Corrected, changed: StoredField) -> tuple[str, ...]:
    """What became of the box."""
    return () if change.box is None else (f"what is kept: {changed.box.describe()}",)


def info_of(
    changed: StoredField, before: FieldInfo, correction: Correction, similarity: Similarity
) -> FieldInfo:
    """What is known of the field now: figures about its surfaces hold as upper bounds, those of free space no more."""
    known = ["box"]  # as what was guessed of it is in the coordinates of before
    if correction.up is not None or correction.floor is not None or correction.find_floor:
        known.append("up")
    if correction.factor is not None:
        known.append("scale")
    # such a name would find ground truth that is not there
    bundled = before.source in scenes.names()
    return replace(
        changed.info,
        source=f"{before.source} (placed)" if bundled else before.source,
        truth="",
        truth_sha256="",
        free_taken_for_free=None,
        surface_taken_for_free=before.surface_taken_for_free,
        unproven_share=freedom_alone(changed, 0.0).unproven_share,
        guesses=still_guessed(before.guesses, known),
        placed=similarity.after(Similarity.of_numbers(before.placed)).numbers if before.placed else (),
        views=views_moved(before.views, similarity),
        position_floor_m=None if before.position_floor_m is None else similarity.scale * before.position_floor_m,
        pose_floor=rescaled(before.pose_floor, similarity.scale),
    )
