"""nerfnav export: trajectories for other programs."""

from collections.abc import Sequence
from dataclasses import dataclass, make_dataclass
from typing import Any

from nerfnav.export import FORMATS
from nerfnav_app.cli.progress import run_and_print
from nerfnav_app.cli.terminal import Output
from nerfnav_app.jobs.export.export import ExportRequest
from nerfnav_app.jobs.export.export import run as run_job


@dataclass(frozen=True)
class Arguments(ExportRequest, Output):
    """Write the trajectory of a plan or a flight in another format."""


def arguments_for(words: Sequence[str]) -> type[Any]:
    """Make the arguments, with a list of the formats in their help."""
    listed = "; ".join(f"{form.name} ({form.purpose})" for form in FORMATS.values())
    about = {"__doc__": f"{Arguments.__doc__}\n\nFormats: {listed}."}
    return make_dataclass("Arguments", [], bases=(Arguments,), frozen=True, namespace=about)


def run(arguments: Arguments) -> None:
    """Export, and print what was written."""
    run_and_print("export", run_job(arguments), arguments.json)
