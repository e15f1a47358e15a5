"""Import of Gaussian splats."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from nerfnav.field import save_field
from nerfnav.geometry import Box
from nerfnav.importers import (
    VoxelizeConfig,
    load_splats,
    save_splats,
    splats_beside,
    upright,
    voxelize,
)
from nerfnav.importers.placement import rotation_to_z
from nerfnav_app.jobs.events import JobEvents, JobResult, Progress
from nerfnav_app.jobs.import_request import ImportRequest
from nerfnav_app.jobs.stored_numbers import numbers_of, placed_by


def import_splats(request: ImportRequest, out: Path) -> JobEvents:
    yield Progress("reading the splats", 0.0)
    place, read = request.placement, load_splats(request.source)
    stands = upright(read, place, request.source)
    splats = read.placed(rotation_to_z(np.array(stands.up)), stands.scale)
    yield Progress("filling the voxels", 0.2)
    box = None if place.box is None else Box.of(*place.box)
    made = voxelize(splats, VoxelizeConfig(voxel=request.voxel, box=box), request.source.name)
    made = replace(made, info=replace(made.info, guesses=stands.guesses))
    yield Progress("storing the field", 0.8)
    bytes_, beside = save_field(made, out), save_splats(splats, splats_beside(out))
    told = {
        "kind": "splats",
        "declared": read.declared,
        "splats": len(read),
        "dropped": read.dropped,
        **placed_by(place, stands.up),
        "guesses": list(stands.guesses),
    }
    return JobResult({**numbers_of(made), "file_bytes": bytes_, "source": told}, (out, beside))
