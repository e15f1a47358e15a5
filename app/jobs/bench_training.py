"""How well a capture is learned in a given time: PSNR on the views that it keeps for judging."""

import time
from collections.abc import Generator
from pathlib import Path

import torch

from nerfnav.compiled import default_threads
from nerfnav.errors import require_positive
from nerfnav.importers.captures.formats import read_views
from nerfnav_app.jobs.events import JobEvent, Progress
from nerfnav_app.jobs.train_config import config_for
from nerfnav_app.jobs.train_voxels import learn_voxels
from nerfnav_app.jobs.training_data.gather import TrainRequest, gather

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

    Each time is one to learn for; looking for what is proven free follows, and is in `train_s` and `cpu_s`, which adds
    up all threads: where others use the machine, it is less than it would be alone. Raises CaptureError where there is
    no capture that a field can be trained from.
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
