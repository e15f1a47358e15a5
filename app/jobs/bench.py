"""Bench: how much faster nerfnav is than the paper's way, both timed on this machine in one run."""

import importlib
import importlib.util
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from app.benchmarks.comparison import Comparison
from app.jobs.events import JobEvents, JobResult, Progress
from app.jobs.experiment import open_arena, png_of, table_text
from app.storage.output_files import json_line, prepare_folder, write_bytes, write_text
from nerfnav.experiments.arena import Arena
from nerfnav.extras import from_extra

MEASURES = ("plan", "replan", "filter", "render", "train_step")
"""What is compared: each is a module of app.benchmarks with a function `measure`."""
QUICK: dict[str, dict[str, Any]] = {
    "plan": {"tasks": 2, "fast_per_round": 3},
    "replan": {"tasks": 2, "rounds": 1},
    "render": {"pictures": 1, "size": 60},
    "train_step": {"rays": 256, "rounds": 1},
    "busy": {"tasks": 1, "rounds": 1},
    "scaling": {"repeats": 10, "tasks": 2},
}
"""What a quick bench asks of each measure, in place of its own defaults."""

Finder = Callable[[str], ModuleType | None]


@dataclass(frozen=True)
class BenchRequest:
    """What to compare."""

    place: str = "stonehenge"
    """Scene to do it in."""
    quick: bool = False
    """Fewer rounds: a first impression, with more spread."""
    out: Path | None = None
    """Folder for bench.json, bench.csv and the plot of the cost of an iteration; None writes nothing."""


def module_named(name: str) -> ModuleType | None:
    """The module of one measure; None where this version has none."""
    full = f"app.benchmarks.{name}"
    return None if importlib.util.find_spec(full) is None else importlib.import_module(full)


def run(request: BenchRequest, find: Finder = module_named) -> JobEvents:
    """Yield which comparison is under way, and return all numbers; what cannot be measured is named under `left_out`.

    Raises MissingExtraError where files are asked for, and matplotlib, which draws one of them, is not installed.
    """
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
    summary |= {
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
        "quick": request.quick,
        "left_out": left_out,
    }
    files: tuple[Path, ...] = ()
    if out is not None:
        yield Progress("measuring how the cost of an iteration grows", 0.95)
        files = save(out, summary, arena, find)
    return JobResult(summary, files)


def numbers(comparison: Comparison) -> dict[str, Any]:
    """What is told of one comparison."""
    named = {"paper_ms": comparison.paper_ms, "fast_ms": comparison.fast_ms, "ratio": comparison.ratio}
    return {**named, "threads": comparison.threads, **comparison.detail}


def save(folder: Path, summary: dict[str, Any], arena: Arena, find: Finder) -> tuple[Path, ...]:
    """Write the numbers, and the plot of what an iteration costs against its size where that can be measured."""
    files = [write_text(folder / "bench.json", json_line(summary) + "\n")]
    measured = [{"name": name, **summary[name]} for name in MEASURES if name in summary]
    shared = ("name", "paper_ms", "fast_ms", "ratio", "threads")
    if measured:
        rows = [{key: row[key] for key in shared} for row in measured]
        files.append(write_text(folder / "bench.csv", table_text(rows)))
    if (scaling := find("scaling")) is not None:
        options = QUICK["scaling"] if summary["quick"] else {}
        files.append(write_bytes(folder / "scaling.png", png_of(scaling.picture(scaling.measure(arena, **options)))))
    return tuple(files)
