"""Import job: make a field of Gaussian splats or of the checkpoint of a NeRF."""

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from tyro.conf import Positional

from nerfnav.core.errors import InvalidInputError, require_positive
from nerfnav.field import NeuralField, StoredField, save_field
from nerfnav.geometry import Box
from nerfnav.importers import (
    UNIT_ASSUMED,
    NerfPytorchConfig,
    Placement,
    SourceKind,
    VoxelizeConfig,
    format_length,
    load_nerf_pytorch,
    load_splats,
    place_splats,
    save_splats,
    source_kind,
    splats_file,
    splats_path,
    voxelize,
    warn_implausible_size,
    wrong_kind_error,
)
from nerfnav.importers.core.placement import rotation_to_z
from nerfnav_app.jobs.events import JobEvents, JobResult, Progress
from nerfnav_app.jobs.field.report import describe_placement, import_numbers
from nerfnav_app.jobs.open.bake import bake_field
from nerfnav_app.storage.output_files import prepare_file


@dataclass(frozen=True)
class ImportOptions:
    """Source, file and options of an import. The command line reads them as they are."""

    source: Positional[Path]
    """Checkpoint, folder with one, or splats: a file, the folder of a SOG's meta.json or of a training, or a .zip."""
    out: Path
    """File for the field; splats themselves are kept beside it."""
    keep_network: bool = False
    """Keep the networks of a NeRF, which take seconds for a picture. By default they become a voxel field, which is
    quick to plan and fly in, and the PSNR between the two is printed."""
    voxel: float | None = None
    """Size of a voxel [m] (default: by the size of the place)."""


@dataclass(frozen=True)
class ImportRequest(ImportOptions):
    """Request of an import: its options, and where the source lies."""

    placement: Placement = field(default_factory=Placement)
    """Placement of the source in the world."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for numbers that no field can have."""
        require_positive(voxel=self.voxel)


def import_splats(request: ImportRequest, out: Path) -> JobEvents:
    yield Progress("reading the splats", 0.0)
    place, read = request.placement, load_splats(request.source)
    stands = place_splats(read, place, Path(splats_file(request.source)))
    splats = read.to_world(rotation_to_z(np.array(stands.up)), stands.scale)
    yield Progress("filling the voxels", 0.2)
    box = None if place.box is None else Box.of(*place.box)
    made = voxelize(splats, VoxelizeConfig(voxel=request.voxel, box=box), request.source.name)
    made = replace(made, info=replace(made.info, guesses=stands.guesses))
    yield Progress("storing the field", 0.8)
    bytes_, beside = save_field(made, out), save_splats(splats, splats_path(out))
    origin = {
        "kind": "splats",
        "declared": read.declared,
        "splats": len(read),
        "dropped": read.dropped,
        **describe_placement(place, stands.up),
        "guesses": list(stands.guesses),
    }
    return JobResult({**import_numbers(made), "file_bytes": bytes_, "source": origin}, (out, beside))


def import_nerf(request: ImportRequest, out: Path) -> JobEvents:
    yield Progress("reading the networks", 0.0)
    found = load_nerf_pytorch(request.source, NerfPytorchConfig(placement=request.placement))
    shape, guesses = found.fine.config, _guesses_of(found, request.placement)
    origin = {
        "kind": "nerf-pytorch",
        **describe_placement(request.placement, (0.0, 0.0, 1.0)),
        "guesses": list(guesses),
        "layers": shape.depth,
        "layer_width": shape.width,
        "directions": shape.direction is not None,
    }
    made: StoredField = found if request.keep_network else (yield from bake_field(found, request.voxel))
    made = replace(made, info=replace(made.info, guesses=guesses))  # type: ignore[type-var]
    return JobResult({**import_numbers(made), "file_bytes": save_field(made, out), "source": origin}, (out,))


def _guesses_of(found: NeuralField, placement: Placement) -> tuple[str, ...]:
    """Guesses about networks: what neither the user nor the files give."""
    guesses = [] if placement.up is not None else ["up is z (the habit of its format)"]
    if placement.meters_per_unit is None:
        longest = float(found.box.size.max())
        guesses.append(f"{UNIT_ASSUMED}, and the place is {format_length(longest)} long")
        if (doubt := warn_implausible_size(longest)) is not None:
            guesses.append(doubt)
    return tuple(guesses)


def run(request: ImportRequest) -> JobEvents:
    """Yield progress, and return the numbers of the stored field.

    Raises InvalidInputError where the source is nothing of these kinds, or the file cannot be written.
    """
    if not request.source.exists():
        raise InvalidInputError(f"there is no file or folder {request.source}")
    kind = source_kind(request.source)
    if kind not in (SourceKind.NERF, SourceKind.SPLATS):
        raise wrong_kind_error(request.source, kind, "a trained NeRF or a file of Gaussian splats")
    out = prepare_file(request.out)
    return import_nerf(request, out) if kind is SourceKind.NERF else import_splats(request, out)
