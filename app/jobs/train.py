"""Train: gather photographs of a source, learn a field from them, store it."""

from collections.abc import Generator
from dataclasses import replace
from pathlib import Path

import torch

from nerfnav.field import TrainStep, VoxelField
from nerfnav_app.jobs.events import JobEvent, JobEvents, JobResult, Progress
from nerfnav_app.jobs.train_config import config_for, require_room
from nerfnav_app.jobs.train_neural import learn_networks
from nerfnav_app.jobs.train_voxels import learn_voxels
from nerfnav_app.jobs.trained_field import judged, noted, numbers_of, stored
from nerfnav_app.jobs.training_data.gather import StoppedError, TrainingData, TrainRequest, gather
from nerfnav_app.storage.output_files import prepare_file

__all__ = ["StoppedError", "TrainRequest", "run"]


def run(request: TrainRequest) -> JobEvents:
    """Yield progress of every picture and reports of the training; return the numbers of the stored field.

    Send True to end early: what was learned so far is then stored and reported as usual.
    Raises NerfnavError where the source cannot be trained from or the file cannot be written.
    """
    out, gathering = prepare_file(request.out), gather(request)
    material = yield from gathering
    # the training's randomness is its own: it does not depend on how the photographs came about
    generator = torch.Generator().manual_seed(request.seed)
    if request.neural is None:
        config = replace(config_for(request, material), field_every=request.save_every)
        require_room(material.box, config.voxel)
        trained = yield from _keeping(learn_voxels(material, config, generator), request, material, out)
    else:
        trained = yield from learn_networks(material, request, request.neural, generator)
    trained = noted(trained, request, material)
    yield Progress("judging", 1.0)
    trained, freedom = judged(trained, material)
    file_bytes, files = stored(trained, material.truth, out)
    summary = {**numbers_of(trained, freedom, file_bytes), "source": material.report}
    return JobResult(summary, files)


def _keeping(
    learning: Generator[JobEvent, bool | None, VoxelField], request: TrainRequest, material: TrainingData, out: Path
) -> Generator[JobEvent, bool | None, VoxelField]:
    """The same training; what it has learned so far is stored in `out`, whole, whenever it tells."""
    stop: bool | None = None
    while True:
        try:
            event = learning.send(stop)
        except StopIteration as end:
            return end.value
        if isinstance(event, TrainStep) and event.so_far is not None:
            stored(noted(event.so_far, request, material), material.truth, out)
        stop = yield event
