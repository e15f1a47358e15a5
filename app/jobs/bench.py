"""Bench: how much faster nerfnav is than the paper's way, both timed on this machine in one run."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from nerfnav.extras import from_extra
from nerfnav_app.benchmarks.comparison import Comparison
from nerfnav_app.jobs.arena import open_arena
from nerfnav_app.jobs.bench_files import save_bench
from nerfnav_app.jobs.bench_measures import MEASURES, QUICK, Finder, module_named
from nerfnav_app.jobs.bench_training import SECONDS, check_capture, measure_training
from nerfnav_app.jobs.events import JobEvents, JobResult, Progress
from nerfnav_app.storage.output_files import prepare_folder


@dataclass(frozen=True)
class BenchRequest:
    """What to compare."""

    place: str = "stonehenge"
    """Scene to do it in."""
    quick: bool = False
    """Fewer rounds: a first impression, with more spread."""
    capture: Path | None = None
    """Capture that is learned besides; None: none is."""
    seconds: tuple[float, ...] = SECONDS
    """Times that it is learned for [s]."""
    out: Path | None = None
    """Folder for bench.json, bench.csv and the plot of the cost of an iteration; None writes nothing."""


def run(request: BenchRequest, find: Finder = module_named) -> JobEvents:
    """Yield which comparison is under way, and return all numbers; what cannot be measured is named under `left_out`.

    Raises MissingExtraError where files are asked for, and matplotlib, which draws one of them, is not installed, and
    InvalidInputError for what is no capture, before anything is measured.
    """
    if request.capture is not None:
        check_capture(request.capture, request.seconds)
    if request.out is not None:
        from_extra("matplotlib.figure", "experiments", "the plot of bench --out")
    out = None if request.out is None else prepare_folder(request.out)
    yield Progress("opening the field", 0.0)
    arena = open_arena(request.place)
    summary: dict[str, Any] = {}
    left_out = [name for name in MEASURES if find(name) is None]
    for index, name in enumerate(MEASURES):
        yield Progress(f"measuring {name}", index / len(MEASURES))
        if (module := find(name)) is not None:
            options = QUICK.get(name, {}) if request.quick else {}
            summary[name] = numbers(module.measure(arena, **options))
    if (busy := find("busy")) is not None:
        yield Progress("measuring beside busy processes", 0.9)
        summary["busy"] = busy.measure(arena, **(QUICK["busy"] if request.quick else {}))
    if (cold := find("cold")) is not None:
        yield Progress("measuring first plans of new processes", 0.92)
        summary["cold"] = cold.measure(request.place, **(QUICK["cold"] if request.quick else {}))
    if request.capture is not None:
        summary["training"] = yield from measure_training(request.capture, request.seconds)
    summary |= {
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
        "quick": request.quick,
        "left_out": left_out,
    }
    files: tuple[Path, ...] = ()
    if out is not None:
        yield Progress("measuring how the cost of an iteration grows", 0.95)
        files = save_bench(out, summary, arena, find)
    return JobResult(summary, files)


def numbers(comparison: Comparison) -> dict[str, Any]:
    """What is told of one comparison."""
    named = {"paper_ms": comparison.paper_ms, "fast_ms": comparison.fast_ms, "ratio": comparison.ratio}
    return {**named, "threads": comparison.threads, **comparison.detail}
