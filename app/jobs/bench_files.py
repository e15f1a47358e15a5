"""Results of a bench as files."""

from pathlib import Path
from typing import Any

from nerfnav.experiments import Arena
from nerfnav_app.jobs.bench_chart import picture
from nerfnav_app.jobs.bench_measures import MEASURES, QUICK, Finder
from nerfnav_app.jobs.result_files import png_of, table_text
from nerfnav_app.storage.output_files import json_line, write_bytes, write_text


def save_bench(folder: Path, summary: dict[str, Any], arena: Arena, find: Finder) -> tuple[Path, ...]:
    """Write the numbers, and plots of what was measured: of how a capture was learned, and of what an iteration costs
    against its size."""
    files = [write_text(folder / "bench.json", json_line(summary) + "\n")]
    measured = [{"name": name, **summary[name]} for name in MEASURES if name in summary]
    shared = ("name", "paper_ms", "fast_ms", "ratio", "threads")
    if measured:
        rows = [{key: row[key] for key in shared} for row in measured]
        files.append(write_text(folder / "bench.csv", table_text(rows)))
    if rows := summary.get("training"):
        files.append(write_bytes(folder / "training.png", png_of(picture(rows, summary["cores"]))))
    if (scaling := find("scaling")) is not None:
        options = QUICK["scaling"] if summary["quick"] else {}
        files.append(write_bytes(folder / "scaling.png", png_of(scaling.picture(scaling.measure(arena, **options)))))
    return tuple(files)
