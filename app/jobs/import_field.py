"""Import: make a field of a NeRF's checkpoint that others have trained or Gaussian splats."""

from collections.abc import Generator
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from app.jobs.events import JobEvent, JobEvents, JobResult, Progress
from app.jobs.validation import require_positive
from app.storage.output_files import prepare_file
from nerfnav.errors import InvalidInputError
from nerfnav.experiments.freedom import freedom_alone, in_words
from nerfnav.field.bake import BakeConfig, BakeStep, bake
from nerfnav.field.checkpoint import StoredField, save_field
from nerfnav.field.field import Field
from nerfnav.field.neural import NeuralField
from nerfnav.field.voxel import VoxelField
from nerfnav.geometry.box import Box
from nerfnav.importers.kind import SourceKind, source_kind, wrong_kind
from nerfnav.importers.nerf_pytorch import NerfPytorchConfig, load_nerf_pytorch
from nerfnav.importers.placement import ONE_UNIT, Placement, Vector, length_in_words, rotation_to_z, size_doubt
from nerfnav.importers.splats.layouts import load_splats
from nerfnav.importers.splats.splats import save_splats, splats_beside
from nerfnav.importers.splats.upright import upright
from nerfnav.importers.splats.voxels import VoxelizeConfig, voxelize


@dataclass(frozen=True)
class ImportRequest:
    """What to import."""

    source: Path
    """A checkpoint, a folder with one, or a file of splats."""
    out: Path
    """The file for the field."""
    voxel: float | None = None
    """Distance of the nodes of a voxel field [m]; None: by the size of the place."""
    keep_network: bool = False
    """Whether a NeRF stays networks, which take seconds for a picture; else it is baked into a voxel field."""
    placement: Placement = field(default_factory=Placement)
    """How the source lies in the world."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for numbers that no field can have."""
        require_positive(voxel=self.voxel)


def imports(source: Path) -> bool:
    """Whether a file or folder is of a kind that is imported, not trained from."""
    return source_kind(source).command == "import"


def run(request: ImportRequest) -> JobEvents:
    """Yield progress, and return the numbers of the stored field.

    Raises InvalidInputError where the source is nothing of these kinds, or the file cannot be written.
    """
    if not request.source.exists():
        raise InvalidInputError(f"there is no file or folder {request.source}")
    kind = source_kind(request.source)
    if kind not in (SourceKind.NERF, SourceKind.SPLATS):
        raise wrong_kind(request.source, kind, "a trained NeRF or a file of Gaussian splats")
    out = prepare_file(request.out)
    return _import_nerf(request, out) if kind is SourceKind.NERF else _import_splats(request, out)


def bake_file(source: StoredField, voxel: float | None, out: Path) -> JobEvents:
    """Bake a field and store the result: yield progress, and return the numbers."""
    require_positive(voxel=voxel)
    prepare_file(out)
    baked = yield from baking(source, voxel)
    return JobResult({**_numbers(baked), "file_bytes": save_field(baked, out)}, (out,))


def baking(source: Field, voxel: float | None) -> Generator[JobEvent, bool | None, VoxelField]:
    """Bake a field, yield progress, and return the result."""
    step: BakeStep | None = None
    for step in bake(source, BakeConfig(voxel=voxel)):
        yield Progress(step.label, step.fraction)
    assert step is not None and step.field is not None, "baking ends with its field"
    return step.field


def _import_nerf(request: ImportRequest, out: Path) -> JobEvents:
    yield Progress("reading the networks", 0.0)
    found = load_nerf_pytorch(request.source, NerfPytorchConfig(placement=request.placement))
    shape, told = found.fine.config, {"kind": "nerf-pytorch", **_placed(request.placement, (0.0, 0.0, 1.0))}
    guesses = _guesses_of(found, request.placement)
    told |= {"guesses": list(guesses)}
    told |= {"layers": shape.depth, "layer_width": shape.width, "directions": shape.direction is not None}
    made: StoredField = found
    if not request.keep_network:
        made = yield from baking(found, request.voxel)
    made = replace(made, info=replace(made.info, guesses=guesses))  # type: ignore[type-var]
    summary = {**_numbers(made), "file_bytes": save_field(made, out), "source": told}
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


def _import_splats(request: ImportRequest, out: Path) -> JobEvents:
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
        **_placed(place, stands.up),
        "guesses": list(stands.guesses),
    }
    return JobResult({**_numbers(made), "file_bytes": bytes_, "source": told}, (out, beside))


def _numbers(made: StoredField) -> dict[str, Any]:
    nodes = {"voxels": int(np.prod(made.shape))} if isinstance(made, VoxelField) else {}
    corners = {"lower": made.box.lower.tolist(), "upper": made.box.upper.tolist()}
    freedom = freedom_alone(made, float(made.spacing.max()) if isinstance(made, VoxelField) else made.step)
    told = {"geometry": asdict(freedom), "in_words": in_words(freedom)}
    return {"box": corners, **nodes, "baked_psnr_db": made.info.baked_psnr_db, **told}


def _placed(placement: Placement, up: Vector) -> dict[str, Any]:
    """Up and scale as they were taken, and which of them nobody gave."""
    given = {"up": placement.up, "scale": placement.meters_per_unit, "box": placement.box}
    return {
        "up": list(placement.up or up),
        "meters_per_unit": placement.meters_per_unit or 1.0,
        "guessed": [name for name, value in given.items() if value is None],
    }
