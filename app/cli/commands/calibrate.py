"""nerfnav calibrate: measure how far the pictures of a field can be trusted."""

from dataclasses import dataclass
from pathlib import Path

from tyro.conf import Positional

from nerfnav_app.cli.progress import run_and_print
from nerfnav_app.cli.terminal import Output
from nerfnav_app.jobs.field.calibrate import CalibrateRequest
from nerfnav_app.jobs.field.calibrate import run as run_job


@dataclass(frozen=True)
class Arguments(Output):
    """Calibrate the filter in a field by pictures from known poses, note the result in the file, and print it."""

    field: Positional[str]
    """Path of a field file, or name of a bundled scene."""
    source: Positional[str | None] = None
    """Scene, mesh or capture that the field was trained from (default: the ground truth beside the field)."""
    out: Path | None = None
    """File for the calibrated field (default: the same file)."""


def run(arguments: Arguments) -> None:
    """Calibrate, store the field, and print the numbers."""
    request = CalibrateRequest(arguments.field, arguments.source, arguments.out)
    run_and_print(f"field {arguments.out or arguments.field}", run_job(request), arguments.json)
