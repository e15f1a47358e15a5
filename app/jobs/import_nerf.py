"""Import of a NeRF that others have trained."""

from pathlib import Path

from app.jobs.bake import baking
from app.jobs.events import JobEvents, JobResult, Progress
from app.jobs.import_request import ImportRequest
from app.jobs.stored_numbers import numbers_of, placed_by
from nerfnav.field import StoredField, save_field
from nerfnav.importers import (
    NerfPytorchConfig,
    load_nerf_pytorch,
)


def import_nerf(request: ImportRequest, out: Path) -> JobEvents:
    yield Progress("reading the networks", 0.0)
    found = load_nerf_pytorch(request.source, NerfPytorchConfig(placement=request.placement))
    shape, told = found.fine.config, {"kind": "nerf-pytorch", **placed_by(request.placement, (0.0, 0.0, 1.0))}
    told |= {"layers": shape.depth, "layer_width": shape.width, "directions": shape.direction is not None}
    made: StoredField = found
    if not request.keep_network:
        made = yield from baking(found, request.voxel)
    summary = {**numbers_of(made), "file_bytes": save_field(made, out), "source": told}
    return JobResult(summary, (out,))
