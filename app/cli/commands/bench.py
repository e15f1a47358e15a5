"""nerfnav bench: how fast this machine is, and how much faster than the paper's way."""

from dataclasses import dataclass
from pathlib import Path

from nerfnav_app.cli.progress import run_and_print
from nerfnav_app.cli.terminal import note
from nerfnav_app.jobs.measure.bench import SECONDS, BenchRequest
from nerfnav_app.jobs.measure.bench import run as run_job


@dataclass(frozen=True)
class Arguments:
    """Time planning, replanning, filtering, rendering and training: the paper's way in plain torch, and nerfnav's."""

    quick: bool = False
    """Fewer rounds: a first impression, with more spread."""
    place: str = "stonehenge"
    """Scene to do it in."""
    out: Path | None = None
    """Folder for bench.json, bench.csv and the plot of an iteration's cost against waypoints x body points."""
    capture: Path | None = None
    """Capture to learn besides, a folder of pictures with poses, with test views best: PSNR for each of --seconds."""
    seconds: tuple[float, ...] = SECONDS
    """Times to learn it for [s], one training each."""
    json: bool = False
    """Print one JSON object and nothing else."""


def run(arguments: Arguments) -> None:
    """Measure, and print the numbers."""
    finished = run_and_print("bench", run_job(_request(arguments)), arguments.json)
    if missing := finished.summary["left_out"]:
        note(f"not measured, for this version cannot: {', '.join(missing)}")
    for path in finished.files:
        note(f"wrote {path}")


def _request(arguments: Arguments) -> BenchRequest:
    return BenchRequest(
        arguments.place, arguments.quick, capture=arguments.capture, seconds=arguments.seconds, out=arguments.out
    )
