"""nerfnav bench: how fast this machine is, and how much faster than the paper's way."""

from dataclasses import dataclass
from pathlib import Path

from app.cli.progress import follow
from app.cli.terminal import note, show
from app.jobs.bench import BenchRequest
from app.jobs.bench import run as run_job


@dataclass(frozen=True)
class Arguments:
    """Time planning, replanning, filtering, rendering and training: the paper's way in plain torch, and nerfnav's."""

    quick: bool = False
    """Fewer rounds: a first impression, with more spread."""
    place: str = "stonehenge"
    """Scene to do it in."""
    out: Path | None = None
    """Folder for bench.json, bench.csv and the plot of an iteration's cost against waypoints x body points."""
    json: bool = False
    """Print one JSON object and nothing else."""


def run(arguments: Arguments) -> None:
    """Measure, and print the numbers."""
    finished = follow(run_job(BenchRequest(arguments.place, arguments.quick, arguments.out)))
    show("bench", finished.summary, arguments.json)
    if missing := finished.summary["left_out"]:
        note(f"not measured, for this version cannot: {', '.join(missing)}")
    for path in finished.files:
        note(f"wrote {path}")
