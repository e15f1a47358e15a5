"""Import of a NeRF that others have trained."""

from dataclasses import replace
from pathlib import Path

from nerfnav.field import NeuralField, StoredField, save_field
from nerfnav.importers import ONE_UNIT, NerfPytorchConfig, Placement, length_in_words, load_nerf_pytorch, size_doubt
from nerfnav_app.jobs.bake import baking
from nerfnav_app.jobs.events import JobEvents, JobResult, Progress
from nerfnav_app.jobs.import_request import ImportRequest
from nerfnav_app.jobs.stored_numbers import numbers_of, placed_by


def import_nerf(request: ImportRequest, out: Path) -> JobEvents:
    yield Progress("reading the networks", 0.0)
    found = load_nerf_pytorch(request.source, NerfPytorchConfig(placement=request.placement))
    shape, told = found.fine.config, {"kind": "nerf-pytorch", **placed_by(request.placement, (0.0, 0.0, 1.0))}
    guesses = _guesses_of(found, request.placement)
    told |= {"guesses": list(guesses)}
    told |= {"layers": shape.depth, "layer_width": shape.width, "directions": shape.direction is not None}
    made: StoredField = found
    if not request.keep_network:
        made = yield from baking(found, request.voxel)
    made = replace(made, info=replace(made.info, guesses=guesses))  # type: ignore[type-var]
    summary = {**numbers_of(made), "file_bytes": save_field(made, out), "source": told}
    return JobResult(summary, (out,))


def _guesses_of(found: NeuralField, placement: Placement) -> tuple[str, ...]:
    """What nobody said of networks, and what the files do not tell."""
    guesses = [] if placement.up is not None else ["up is z (the habit of its format)"]
    if placement.meters_per_unit is None:
        longest = float(found.box.size.max())
        guesses.append(f"{ONE_UNIT}, and the place is {length_in_words(longest)} long")
        if (doubt := size_doubt(longest)) is not None:
            guesses.append(doubt)
    return tuple(guesses)
