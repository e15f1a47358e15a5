"""nerfnav bake: from any field to a voxel field."""

from dataclasses import dataclass
from pathlib import Path

from tyro.conf import Positional

from nerfnav.field import load_field
from nerfnav_app.cli.progress import run_and_print
from nerfnav_app.cli.terminal import Output
from nerfnav_app.jobs.open.bake import bake_file
from nerfnav_app.places.place import field_file


@dataclass(frozen=True)
class Arguments(Output):
    """Turn a field into a voxel field, which is quick to plan and fly in, and print the PSNR between the two."""

    field: Positional[str]
    """Path of a field file, or name of a bundled scene."""
    out: Path
    """File for the voxel field."""
    voxel: float | None = None
    """Size of a voxel [m] (default: a 160th of the longest edge)."""


def run(arguments: Arguments) -> None:
    """Bake, store the field, and print its numbers."""
    field = load_field(field_file(arguments.field))
    run_and_print(f"field {arguments.out}", bake_file(field, arguments.voxel, arguments.out), arguments.json)
