"""Bench job: compare the speed of nerfnav with that of the paper's method, both timed on this machine in one run.

With a capture, it also measures how well that is learned in given times: PSNR on the held-out views. The results are
numbers, tables and plots.
"""

import importlib
import importlib.util
import time
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import torch

from nerfnav.core.errors import require_positive
from nerfnav.core.extras import import_extra
from nerfnav.core.jit import count_cores, default_threads
from nerfnav.experiments import Arena
from nerfnav.experiments.figures import COLORS, file_of, panels
from nerfnav.importers.captures.formats import read_views
from nerfnav_app.benchmarks.comparison import Comparison
from nerfnav_app.jobs.events import JobEvent, JobEvents, JobResult, Progress
from nerfnav_app.jobs.field.train import config_for, learn_voxels
from nerfnav_app.jobs.field.training_data import TrainRequest, gather
from nerfnav_app.jobs.measure.arena import open_arena
from nerfnav_app.jobs.measure.results import table_text
from nerfnav_app.storage.output_files import json_line, prepare_folder, write_bytes, write_text

if TYPE_CHECKING:
    import matplotlib.figure


MEASURES = ("plan", "replan", "filter", "render", "train_step")
"""What is compared: each is a module of nerfnav_app.benchmarks with a function `measure`."""
QUICK: dict[str, dict[str, Any]] = {
    "plan": {"tasks": 1, "fast_per_round": 3},
    "replan": {"tasks": 2, "rounds": 1},
    "filter": {"views": 2, "fast_per_round": 3},
    "render": {"pictures": 1, "size": 60},
    "train_step": {"rays": 256, "rounds": 1},
    "busy": {"tasks": 1, "rounds": 1},
    "cold": {"rounds": 1},
    "opening": {"seconds": 5.0},
    "scaling": {"repeats": 10, "tasks": 2},
}
"""What a quick bench asks of each measure, in place of its own defaults."""
Finder = Callable[[str], ModuleType | None]


def module_named(name: str) -> ModuleType | None:
    """The module of one measure; None where this version has none."""
    full = f"nerfnav_app.benchmarks.{name}"
    return None if importlib.util.find_spec(full) is None else importlib.import_module(full)


SECONDS = (30.0, 120.0, 300.0, 900.0)
"""Times that a capture is learned for [s], one training each: how fast it goes depends on when it ends."""
Row = dict[str, float | int | None]


def check_capture(source: Path, seconds: tuple[float, ...]) -> None:
    """Raise InvalidInputError or CaptureError for what cannot be learned from, or for no time at all [s]."""
    read_views(source)
    for budget in seconds:
        require_positive(seconds=budget)


def measure_training(source: Path, seconds: tuple[float, ...] = SECONDS) -> Generator[JobEvent, bool | None, list[Row]]:
    """Yield progress; return for each time what came of it.

    Each time is one to learn and to prove space free. `cpu_s` adds up all threads: where others use the machine, it is
    less than it would be alone. Raises CaptureError where there is no capture that a field can be trained from.
    """
    rows: list[Row] = []
    for budget in seconds:
        # no file is written: `out` is what a request of `nerfnav train` has besides
        request = TrainRequest(str(source), Path("bench.npz"), budget=budget)
        material = yield from gather(request)
        config = config_for(request, material)
        yield Progress(f"learning {source.name} for {budget:g} s", 0.0)
        begun = time.process_time()
        trained = yield from learn_voxels(material, config, torch.Generator().manual_seed(0))
        info = trained.info
        rows.append(
            {"budget_s": budget, "psnr_db": info.psnr_db, "views": len(material.held_out),
             "iterations": info.iterations, "voxel_m": config.voxel, "train_s": info.train_s,
             "threads": default_threads(), "cpu_s": time.process_time() - begun}
        )  # fmt: skip
    return rows


def picture(rows: Sequence[Row], cores: int) -> "matplotlib.figure.Figure":
    """PSNR on held-out views against the time to learn, with the CPU time that the machine had for it."""
    figure, (axes,) = panels((f"Held-out views, {cores} cores",))
    minutes = [float(row["budget_s"] or 0) / 60 for row in rows]
    psnr = [float(row["psnr_db"] or 0) for row in rows]
    axes.plot(minutes, psnr, "o-", color=COLORS[0])
    for place, row in zip(zip(minutes, psnr, strict=True), rows, strict=True):
        label = f"{place[1]:.1f} dB\n{row['cpu_s']:.0f} CPU s"
        axes.annotate(label, place, xytext=(0, 6), textcoords="offset points", ha="center", fontsize=8)
    axes.margins(0.15, 0.25)
    axes.set_xscale("log")
    axes.set_xticks(minutes, [f"{each:g}" for each in minutes])
    axes.minorticks_off()
    axes.set_xlabel("minutes to learn")
    axes.set_ylabel("PSNR [dB]")
    return figure


def save_bench(folder: Path, summary: dict[str, Any], arena: Arena, find: Finder) -> tuple[Path, ...]:
    """Write the numbers, and plots of what was measured: of how a capture was learned, and of what an iteration costs
    against its size."""
    files = [write_text(folder / "bench.json", json_line(summary) + "\n")]
    shared = ("paper_ms", "fast_ms", "ratio", "threads")
    measured = [name for name in MEASURES if name in summary]
    if rows := [{"name": name, **{key: summary[name][key] for key in shared}} for name in measured]:
        files.append(write_text(folder / "bench.csv", table_text(rows)))
    if rows := summary.get("training"):
        files.append(write_bytes(folder / "training.png", file_of(picture(rows, summary["cores"]), "png")))
    if (scaling := find("scaling")) is not None:
        options = QUICK["scaling"] if summary["quick"] else {}
        drawn = scaling.picture(scaling.measure(arena, **options))
        files.append(write_bytes(folder / "scaling.png", file_of(drawn, "png")))
    return tuple(files)


@dataclass(frozen=True)
class BenchRequest:
    """Request of a benchmark: place, capture and times. The command line reads it as it is."""

    place: str = "stonehenge"
    """Scene to measure in."""
    quick: bool = False
    """Fewer rounds: a first impression, with more variance."""
    capture: Path | None = None
    """Folder of a capture to learn as well, best with test views; prints its PSNR for each of --seconds."""
    seconds: tuple[float, ...] = SECONDS
    """Training times of the capture [s]."""
    out: Path | None = None
    """Folder for bench.json, bench.csv and the plot of an iteration's cost against waypoints x body points."""


def run(request: BenchRequest, find: Finder = module_named) -> JobEvents:
    """Yield which comparison is under way, and return all numbers; what cannot be measured is named under `left_out`.

    Raises MissingExtraError where files are asked for, and matplotlib, which draws one of them, is not installed, and
    InvalidInputError for what is no capture, before anything is measured.
    """
    if request.capture is not None:
        check_capture(request.capture, request.seconds)
    if request.out is not None:
        import_extra("matplotlib.figure", "experiments", "the plot of bench --out")
    out = None if request.out is None else prepare_folder(request.out)
    yield Progress("opening the field", 0.0)
    arena = open_arena(request.place)
    summary: dict[str, Any] = {}
    quick = QUICK if request.quick else {}
    for index, name in enumerate(MEASURES):
        yield Progress(f"measuring {name}", index / len(MEASURES))
        if (module := find(name)) is not None:
            summary[name] = numbers(module.measure(arena, **quick.get(name, {})))
    if (busy := find("busy")) is not None:
        yield Progress("measuring beside busy processes", 0.9)
        summary["busy"] = busy.measure(arena, **quick.get("busy", {}))
    if (cold := find("cold")) is not None:
        yield Progress("measuring first plans of new processes", 0.92)
        summary["cold"] = cold.measure(request.place, **quick.get("cold", {}))
    if (opening := find("opening")) is not None:
        yield Progress("opening a house", 0.94)
        summary["open"] = opening.measure(**quick.get("opening", {}))
    if request.capture is not None:
        summary["training"] = yield from measure_training(request.capture, request.seconds)
    summary |= {
        "cores": count_cores(),
        "quick": request.quick,
        "left_out": [name for name in MEASURES if name not in summary],
    }
    files: tuple[Path, ...] = ()
    if out is not None:
        yield Progress("measuring how the cost of an iteration grows", 0.95)
        files = save_bench(out, summary, arena, find)
    return JobResult(summary, files)


def numbers(comparison: Comparison) -> dict[str, Any]:
    """Collect the numbers of one comparison."""
    return {
        "paper_ms": comparison.paper_ms,
        "fast_ms": comparison.fast_ms,
        "ratio": comparison.ratio,
        "threads": comparison.threads,
        **comparison.detail,
    }
