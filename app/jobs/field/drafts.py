"""Draft of a capture: a field to plan in at once, of its depth maps or of a short training, which is trained on later.

As with fields baked from meshes (baked.py), one plans and flies in the draft while the better field is made.
"""

from collections.abc import Generator
from dataclasses import replace
from pathlib import Path

import torch

from nerfnav.core.deadline import Deadline
from nerfnav.field import TrainConfig, VoxelField, load_field
from nerfnav_app.jobs.events import JobEvents, JobResult
from nerfnav_app.jobs.field import train
from nerfnav_app.jobs.field.report import noted, stored
from nerfnav_app.jobs.field.request import TrainRequest
from nerfnav_app.jobs.field.train import config_for, learn_voxels, require_map_memory
from nerfnav_app.jobs.field.training_data import gather
from nerfnav_app.places.sources import BUDGETS_S, QualityName
from nerfnav_app.storage.output_files import prepare_file

_REPORT_EVERY = 2
"""Training steps between two answers, for which plans wait."""


def draft(request: TrainRequest) -> JobEvents:
    """Yield progress, and store a draft of a capture: its depth maps fused, else a training of the draft's budget.

    Raises NerfnavError where the source cannot be trained from or the file cannot be written.
    """
    out = prepare_file(request.out)
    material = yield from gather(request)
    budget = Deadline(BUDGETS_S["draft"])  # from here: posing the frames of a video may take longer
    if material.learned.depth is None:
        brief = replace(request, quality="draft", budget=budget.seconds)
        return (yield from train.learn(brief, material, budget, "draft"))
    config = replace(config_for(request, material), iterations=0, budget=None)
    require_map_memory(material.box, config.voxel)
    fused = yield from learn_voxels(material, config, torch.Generator().manual_seed(request.seed))
    _, files = stored(noted(fused, request, material, "fused"), material.truth, out)
    return JobResult({"source": material.report}, files)


def refine(
    source: Path, file: Path, quality: QualityName, seconds: float
) -> Generator[VoxelField | None, None, None]:
    """Train a field of a capture in the place of its draft; yield None after each step, and the stored field once.

    Its budget of `seconds` counts the time of the steps alone, not that between them.
    """
    clock = Deadline()
    config = TrainConfig(report_every=_REPORT_EVERY)
    request = TrainRequest(str(source), file, quality=quality, budget=seconds, config=config)
    for _ in train.run(request, clock):
        with clock.paused():
            yield None
    field = load_field(file)
    assert isinstance(field, VoxelField), "a training without networks makes voxels"
    yield field
