"""nerfnav report: one page of what experiments have measured, to read or to send."""

from dataclasses import dataclass

from nerfnav_app.cli.progress import run_and_print
from nerfnav_app.cli.terminal import Output, note
from nerfnav_app.jobs.measure.report import ReportRequest
from nerfnav_app.jobs.measure.report import run as run_job


@dataclass(frozen=True)
class Arguments(ReportRequest, Output):
    """Write one HTML page with the tables, figures and flights of a folder of experiments; it opens offline."""


def run(arguments: Arguments) -> None:
    """Write the page, and print what is in it."""
    finished = run_and_print(f"report {arguments.folder}", run_job(arguments), arguments.json)
    for path in finished.files:
        note(f"wrote {path}")
