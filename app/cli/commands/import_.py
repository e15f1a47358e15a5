"""nerfnav import: from a trained NeRF or Gaussian splats to a field."""

from dataclasses import dataclass, field

from tyro.conf import OmitArgPrefixes

from nerfnav_app.cli.arguments import PlacementArguments
from nerfnav_app.cli.progress import run_and_print
from nerfnav_app.cli.terminal import Output
from nerfnav_app.jobs.open.import_field import ImportOptions, ImportRequest
from nerfnav_app.jobs.open.import_field import run as run_job


@dataclass(frozen=True)
class Arguments(ImportOptions, Output):
    """Make a field of a trained NeRF (nerf-pytorch) or of Gaussian splats (.ply, .splat, .spz, .sog, .ksplat)."""

    placement: OmitArgPrefixes[PlacementArguments] = field(default_factory=PlacementArguments)
    """Placement of the source in the world; what is not given is guessed, and the guess is printed."""


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
