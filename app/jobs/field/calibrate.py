"""Calibrate job: measure how far the pictures of a stored field can be trusted, and note it in the file."""

from collections.abc import Generator
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import torch

import nerfnav_scenes as scenes
from nerfnav.core.errors import InvalidInputError
from nerfnav.estimator import Calibration, calibrate_field
from nerfnav.field import StoredField, VoxelField, load_field, save_field
from nerfnav.geometry import PosedImages
from nerfnav.importers import SourceKind, source_kind
from nerfnav.world import CaptureConfig, Scene
from nerfnav_app.jobs.events import JobEvent, JobEvents, JobResult, Progress
from nerfnav_app.jobs.field.bundled import photograph
from nerfnav_app.jobs.field.request import TrainRequest
from nerfnav_app.jobs.field.training_data import gather
from nerfnav_app.places.place import field_file, ground_truth
from nerfnav_app.storage.output_files import prepare_file

_PICTURES = 60
"""Pictures that are taken of a scene or mesh."""
_FOREIGN = 0.5
"""Share of failed corrections from which the pictures are of another place."""


@dataclass(frozen=True)
class CalibrateRequest:
    """Request of a calibration."""

    field: str
    """Path of a field file, or name of a bundled scene."""
    source: str | None
    """Scene or capture that shows the same place; None: the ground truth that the field knows."""
    out: Path | None
    """File for the calibrated field; None: the same file."""


def run(request: CalibrateRequest) -> JobEvents:
    """Yield progress; return the calibration. Raises InvalidInputError for pictures that do not show the field."""
    path = field_file(request.field)
    field, out = load_field(path), request.out or path
    if request.out is None and request.field in scenes.names():
        raise InvalidInputError(f"the field of {request.field} comes with nerfnav: give --out FILE for the new one")
    if not isinstance(field, VoxelField):
        raise InvalidInputError(f"{request.field} is no voxel field: bake it first")
    prepare_file(out)
    pictures, truth = yield from _pictures_of(field, path, request.source)
    yield Progress("calibrating", 0.5)
    found = require_own(calibrate_field(field, field.info, pictures), request.field, len(pictures))
    info = found.note_in(field.info)
    info = info if truth is None else replace(info, pose_floor=())
    return JobResult({**asdict(found), "file_bytes": save_field(replace(field, info=info), out)}, (out,))


def require_own(found: Calibration | None, what: str, pictures: int) -> Calibration:
    """Return a calibration by pictures of the field itself. Raises InvalidInputError for any other."""
    if found is None:
        raise InvalidInputError(f"too few of {pictures} pictures of {what} show anything: calibrate with more pictures")
    if found.failed_share > _FOREIGN:
        raise InvalidInputError(
            f"{found.failed_share:.0%} of the corrections in {what} failed: the source shows another place, or is "
            "placed otherwise; give the one that the field was trained from"
        )
    return found


def _pictures_of(
    field: StoredField, path: Path, source: str | None
) -> Generator[JobEvent, bool | None, tuple[PosedImages, Scene | None]]:
    """Pictures from known poses, none of which the field learned from, and the ground truth where there is one."""
    if source is not None and source_kind(source, scenes.names()) is not SourceKind.SCENE:
        material = yield from gather(TrainRequest(source, path, seed=field.info.seed + 1))
        return (material.held_out if material.truth is None else material.learned), material.truth
    truth = scenes.load(source) if source is not None else None
    if truth is None:
        known = ground_truth(field, path)
        if known is None:
            raise InvalidInputError(f"the source of {path} is not at hand: name the mesh or capture that it shows")
        truth = known.load()
    config = replace(CaptureConfig().clear_of(field.resolution), images=_PICTURES, inside_share=1.0)
    return (yield from photograph(truth, config, torch.Generator().manual_seed(field.info.seed + 1))), truth
