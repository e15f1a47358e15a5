"""nerfnav import: from a trained NeRF or Gaussian splats to a field."""

from dataclasses import dataclass, field
from pathlib import Path

from tyro.conf import OmitArgPrefixes, Positional

from nerfnav_app.cli.commands.train import PlacementArguments
from nerfnav_app.cli.progress import run_and_print
from nerfnav_app.jobs.open.import_field import ImportRequest
from nerfnav_app.jobs.open.import_field import run as run_job


@dataclass(frozen=True)
class Arguments:
    """Make a field of a trained NeRF (nerf-pytorch) or of Gaussian splats (.ply, .splat, .spz, .sog, .ksplat)."""

    source: Positional[Path]
    """A checkpoint, a folder with one, or splats: a file, or the folder of a SOG's meta.json."""
    out: Path
    """File for the field; splats themselves are kept beside it."""
    keep_network: bool = False
    """Keep a NeRF's networks, which take seconds for a picture; by default they become a voxel field, which is quick to
    plan and fly in, and it is told how alike the two look."""
    voxel: float | None = None
    """Size of the field's voxels [m]; by default what suits the size of the place."""
    placement: OmitArgPrefixes[PlacementArguments] = field(default_factory=PlacementArguments)
    """How the source lies in the world."""
    json: bool = False
    """Print one JSON object and nothing else."""


def run(arguments: Arguments) -> None:
    """Import, store the field, and print what was found and what was guessed."""
    request = ImportRequest(
        arguments.source,
        arguments.out,
        voxel=arguments.voxel,
        keep_network=arguments.keep_network,
        placement=arguments.placement.placement(),
    )
    run_and_print(f"field {arguments.out}", run_job(request), arguments.json)
