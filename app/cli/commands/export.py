"""nerfnav export: trajectories for other programs."""

from collections.abc import Sequence
from dataclasses import dataclass, make_dataclass
from pathlib import Path
from typing import Any

from tyro.conf import Positional

from nerfnav.export import FORMATS
from nerfnav_app.cli.progress import run_and_print
from nerfnav_app.jobs.export.export import ExportRequest
from nerfnav_app.jobs.export.export import run as run_job


@dataclass(frozen=True)
class Arguments:
    """Write the trajectory of a plan or a flight in another format."""

    run: Positional[Path]
    """Folder that `nerfnav plan --out` or `nerfnav fly` wrote, or the name of a flight in runs/."""
    format: str
    """Name of the format, as they are listed above."""
    out: Path
    """File to write."""
    force: bool = False
    """Write also what should not be flown, such as a plan beyond the robot's limits."""
    datum: tuple[float, float, float] | None = None
    """Latitude [deg], longitude [deg] and height [m] of the world's origin, for formats that count in degrees."""
    json: bool = False
    """Print one JSON object and nothing else."""


def arguments_for(words: Sequence[str]) -> type[Any]:
    """The arguments, whose help lists the formats that there are."""
    listed = "; ".join(f"{form.name} ({form.purpose})" for form in FORMATS.values())
    chosen = make_dataclass("Arguments", [], bases=(Arguments,), frozen=True)
    chosen.__doc__ = f"{Arguments.__doc__}\n\nFormats: {listed}."
    return chosen


def run(arguments: Arguments) -> None:
    """Export, and tell what was written."""
    request = ExportRequest(arguments.run, arguments.format, arguments.out, arguments.force, arguments.datum)
    run_and_print("export", run_job(request), arguments.json)
