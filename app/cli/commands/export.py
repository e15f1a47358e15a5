"""nerfnav export: the plan, the executed path or the estimate for other programs."""

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
    """Write a run's plan, executed path or estimate in another format."""


def arguments_for(words: Sequence[str]) -> type[Any]:
    """Make the arguments, with a list of the formats and of their default subjects in their help."""
    entries = (f"  {form.name:15}{form.subjects[0].value:10}{form.purpose}" for form in FORMATS.values())
    about = {"__doc__": "\n\n".join([Arguments.__doc__ or "", "Formats, and the --of of each by default:", *entries])}
    return make_dataclass("Arguments", [], bases=(Arguments,), frozen=True, namespace=about)


def run(arguments: Arguments) -> None:
    """Export, and print what was written."""
    run_and_print("export", run_job(arguments), arguments.json)
