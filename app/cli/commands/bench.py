"""nerfnav bench: time nerfnav on this machine against the paper's way; `bench open`: time the opening of files."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from nerfnav_app.cli.progress import run_and_print
from nerfnav_app.cli.terminal import Output, note
from nerfnav_app.jobs.measure.bench import BenchRequest
from nerfnav_app.jobs.measure.bench import run as run_job
from nerfnav_app.jobs.measure.opening import OpeningRequest
from nerfnav_app.jobs.measure.opening import run as run_opening


@dataclass(frozen=True)
class Arguments(BenchRequest, Output):
    """Time planning, replanning, filtering, rendering and training: the paper's way in plain torch, and nerfnav's."""


@dataclass(frozen=True)
class OpenArguments(OpeningRequest, Output):
    """Time how long files take to be shown, planned in, flown in, and trained."""


def arguments_for(words: Sequence[str]) -> type[Any]:
    """Choose the arguments of `bench open`, or those of the comparison."""
    return OpenArguments if list(words[:1]) == ["open"] else Arguments


def run(arguments: Arguments | OpenArguments) -> None:
    """Measure, and print the numbers."""
    if isinstance(arguments, OpenArguments):
        run_and_print("bench open", run_opening(arguments), arguments.json)
        return
    finished = run_and_print("bench", run_job(arguments), arguments.json)
    if missing := finished.summary["left_out"]:
        note(f"not measured, this version lacks them: {', '.join(missing)}")
    for path in finished.files:
        note(f"wrote {path}")
