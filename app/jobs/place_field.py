"""Place: put a field right by hand, its scale, its floor and its box, without training again."""

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import torch

from app.jobs.events import JobEvents, JobResult, Progress
from app.jobs.placed_field import cut_in_words, info_of, moved_field, placed_splats, truth_of, voxels_of
from app.jobs.trained_field import stored
from app.places.place import field_file
from app.storage.output_files import OutputError, prepare_file
from nerfnav.errors import InvalidInputError
from nerfnav.experiments import freedom_alone, in_words
from nerfnav.field import VoxelField, load_field
from nerfnav.field.codec import StoredField
from nerfnav.field.surface_points import surface_points
from nerfnav.importers import Correction, Splats, corrected, load_splats, save_splats, splats_beside
from nerfnav.world import Scene

_ALONG = 160
"""Points along the longest edge at which surfaces are looked for."""
_UP = (0.0, 0.0, 1.0)


@dataclass(frozen=True)
class PlaceRequest:
    """What to put right."""

    what: str
    """Path of a field file, or name of a bundled scene."""
    correction: Correction
    """What was measured and pointed at."""
    out: Path
    """The file for the field, another one than that which it is made of."""


@dataclass(frozen=True, eq=False)
class _Made:
    """What is stored."""

    field: StoredField
    splats: Splats | None
    truth: Scene | None
    told: tuple[str, ...]


def run(request: PlaceRequest) -> JobEvents:
    """Yield progress, and return what has changed and what was guessed.

    Splats that lie beside the field are put right and made into voxels again; ground truth beside it goes along.
    Raises NerfnavError where nothing is asked for, or it cannot be done.
    """
    correction = request.correction
    if correction.is_empty:
        raise InvalidInputError("nothing is to be changed: give --measure, --scale, --floor, --up or --box")
    path = field_file(request.what)
    out = prepare_file(request.out)
    if out.exists() and out.samefile(path):
        raise OutputError(f"{out} is the field itself: choose another file, so that you can go back to this one")
    field = load_field(path)
    yield Progress("looking for surfaces", 0.05)
    points = surface_points(field, float(field.box.size.max()) / _ALONG, correction.up or _UP)
    change = corrected(correction, field.box, points, torch.Generator().manual_seed(0))
    beside = splats_beside(path)
    splats = placed_splats(load_splats(beside), change) if beside.is_file() else None
    changed = (yield from moved_field(field, change)) if splats is None else voxels_of(splats, field, change)
    truth, told = truth_of(field, path, change, changed)
    told = (*change.told, *cut_in_words(change, changed), *told)
    changed = replace(changed, info=info_of(changed, field.info, correction, change.similarity))  # type: ignore[type-var]
    yield Progress("storing the field", 0.95)
    return _stored(_Made(changed, splats, truth, told), out)


def _stored(made: _Made, out: Path) -> JobResult:
    size, files = stored(made.field, made.truth, out)
    if made.splats is not None:
        files = (*files, save_splats(made.splats, splats_beside(out)))
    return JobResult({**_numbers(made), "file_bytes": size}, files)


def _numbers(made: _Made) -> dict[str, Any]:
    field = made.field
    voxel = float(field.spacing.max()) if isinstance(field, VoxelField) else field.step
    freedom = freedom_alone(field, voxel)
    return {
        "box": {"lower": field.box.lower.tolist(), "upper": field.box.upper.tolist()},
        "voxel_m": voxel,
        "changed": list(made.told),
        "guesses": list(field.info.guesses),
        "geometry": asdict(freedom),
        "in_words": in_words(freedom),
    }
