"""Place: put a field right by hand, its scale, its floor and its box, without training again."""

from dataclasses import dataclass, replace
from pathlib import Path

import torch

from nerfnav.errors import InvalidInputError
from nerfnav.field import load_field, surface_points
from nerfnav.importers import Correction, corrected, load_splats, splats_beside
from nerfnav_app.jobs.events import JobEvents, Progress
from nerfnav_app.jobs.place_report import Placed, save
from nerfnav_app.jobs.placed_field import cut_in_words, info_of, moved_field, placed_splats, truth_of, voxels_of
from nerfnav_app.places.place import field_file
from nerfnav_app.storage.output_files import OutputError, prepare_file

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
    return save(Placed(changed, splats, truth, told), out)
