"""Draft of a capture: a field to plan in at once, of its depth maps or of a short training, which is trained on later.

As with fields baked from meshes (baked.py), one plans and flies in the draft while the better field is made.
"""

from collections.abc import Generator
from dataclasses import replace
from pathlib import Path

import torch

from nerfnav.core.deadline import Deadline
from nerfnav.core.steps import map_steps
from nerfnav.field import TrainConfig, VoxelField, load_field
from nerfnav_app.jobs.events import JobEvent, JobEvents, JobResult, Progress
from nerfnav_app.jobs.field import train
from nerfnav_app.jobs.field.report import judge_field, noted, stored
from nerfnav_app.jobs.field.request import TrainRequest
from nerfnav_app.jobs.field.train import config_for, learn_voxels, require_map_memory
from nerfnav_app.jobs.field.training_data import TrainingData, gather
from nerfnav_app.places.sources import BUDGETS_S, PICTURE_EVERY_S, QualityName
from nerfnav_app.storage.output_files import prepare_file

_REPORT_EVERY = 2
"""Training steps between two answers, for which plans wait."""
_LEAST_STEPS = 40
"""Training steps of a draft on a machine that is busy elsewhere, however long they take: the fox shows nothing to plan
in after 6."""
_LONGEST = 320
"""Longest side of the pictures of a draft [pixels], of those with depth that it is judged by: its voxels show little
more, and the evaluation takes as long as there are pixels (the fox: 21 s of a processor with 640, 5 s with 320)."""
_TRIED, _TRIED_LONGEST, _TRIED_NODES, _TRIED_STEPS = 4, 64, 32, 6
"""Pictures, their longest side [pixels], nodes along the longest edge, and training steps that compile all kernels."""


def draft(request: TrainRequest) -> JobEvents:
    """Yield progress, and store a draft of a capture: its depth maps fused, else a training of the draft's budget.

    Raises NerfnavError where the source cannot be trained from or the file cannot be written.
    """
    out = prepare_file(request.out)
    material = yield from gather(request)
    material = replace(material, held_out=material.held_out.shrunk(_LONGEST))
    if material.learned.depth is None:
        small = replace(material, learned=material.learned.shrunk(_LONGEST))
        config = replace(request.config, report_every=_REPORT_EVERY, least_iterations=_LEAST_STEPS)
        brief = replace(request, quality="draft", config=config)
        yield from _compile_kernels(brief, small)
        budget = Deadline(BUDGETS_S["draft"])  # from here: posing the frames of a video may take longer
        return (yield from train.learn(replace(brief, budget=budget.seconds), small, budget, "draft"))
    # what is around the box is learned, and nothing is learned yet
    config = replace(config_for(request, material), iterations=0, budget=None, outside=0)
    require_map_memory(request.source, material.box, config.voxel)
    yield Progress("fusing the depth maps", 0.5)
    fused = yield from learn_voxels(material, config, torch.Generator().manual_seed(request.seed))
    _, files = stored(noted(fused, request, material, "fused"), material.truth, out)
    return JobResult({"source": material.report}, files)


def _compile_kernels(request: TrainRequest, material: TrainingData) -> Generator[JobEvent, bool | None, None]:
    """Train a tiny field of few tiny pictures and judge it: then kernels are compiled, and no budget pays for that."""
    preparing = Progress("preparing the training", 0.0)
    yield preparing
    learned, held_out = (
        part.subset(slice(_TRIED)).shrunk(_TRIED_LONGEST) for part in (material.learned, material.held_out)
    )
    tiny, config = replace(material, learned=learned, held_out=held_out), config_for(request, material)
    config = replace(
        config, voxel=float(material.box.size.max()) / _TRIED_NODES, outside=min(config.outside, _TRIED_NODES),
        iterations=_TRIED_STEPS, budget=None,
    )  # fmt: skip
    generator = torch.Generator().manual_seed(request.seed)
    field = yield from map_steps(learn_voxels(tiny, config, generator), lambda _: preparing)
    yield from map_steps(judge_field(field, tiny, Deadline(0.0)), lambda _: preparing)


def refine(
    source: Path, file: Path, quality: QualityName, seconds: float
) -> Generator[JobEvent | VoxelField, None, None]:
    """Train a field of a capture in the place of its draft; yield what that yields, and the stored field once.

    Its budget of `seconds` counts the time of the steps alone, not that between them.
    """
    clock = Deadline()
    config = TrainConfig(report_every=_REPORT_EVERY, picture_every=PICTURE_EVERY_S)
    request = TrainRequest(str(source), file, quality=quality, budget=seconds, config=config)
    for event in train.run(request, clock):
        with clock.paused():
            yield event
    field = load_field(file)
    assert isinstance(field, VoxelField), "a training without networks makes voxels"
    yield field
