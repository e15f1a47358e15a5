"""nerfnav map: occupancy map of a field, for other programs."""

from dataclasses import dataclass

from tyro.conf import Positional

from nerfnav.field import load_field
from nerfnav_app.cli.progress import run_and_print
from nerfnav_app.cli.terminal import Output
from nerfnav_app.jobs.export.occupancy_map import MapRequest
from nerfnav_app.jobs.export.occupancy_map import run as run_job
from nerfnav_app.places.place import field_file


@dataclass(frozen=True, kw_only=True)
class Arguments(MapRequest, Output):
    """Write which space planners take for free, solid or unproven, before any body is put into it.

    The ending of --out says how: .npz (voxels: 0 free, 1 solid, 2 unproven), .glb (a collision mesh), .pgm or .yaml
    (one layer as a map of ROS: both files are written).
    """

    field: Positional[str]
    """Path of a field file, or name of a bundled scene."""


def run(arguments: Arguments) -> None:
    """Make the map, and print how much of it is free."""
    field = load_field(field_file(arguments.field))
    run_and_print(f"map {arguments.out}", run_job(field, arguments), arguments.json)
