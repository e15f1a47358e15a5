"""nerfnav bench: time nerfnav on this machine against the paper's way."""

from dataclasses import dataclass

from nerfnav_app.cli.progress import run_and_print
from nerfnav_app.cli.terminal import Output, note
from nerfnav_app.jobs.measure.bench import BenchRequest
from nerfnav_app.jobs.measure.bench import run as run_job


@dataclass(frozen=True)
class Arguments(BenchRequest, Output):
    """Time planning, replanning, filtering, rendering and training: the paper's way in plain torch, and nerfnav's."""


def run(arguments: Arguments) -> None:
    """Measure, and print the numbers."""
    finished = run_and_print("bench", run_job(arguments), arguments.json)
    if missing := finished.summary["left_out"]:
        note(f"not measured, this version lacks them: {', '.join(missing)}")
    for path in finished.files:
        note(f"wrote {path}")
