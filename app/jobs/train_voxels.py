"""Training of a voxel field, as a part of the job."""

from collections.abc import Generator

import torch

from nerfnav.field import TrainConfig, VoxelField
from nerfnav.field.train import train
from nerfnav_app.jobs.events import JobEvent, Progress
from nerfnav_app.jobs.training_data.gather import TrainingData


def learn_voxels(
    material: TrainingData, config: TrainConfig, generator: torch.Generator
) -> Generator[JobEvent, bool | None, VoxelField]:
    """Yield reports and progress; return the field. Send True to end early."""
    steps = train(material.learned, material.held_out, material.box, material.background, config, generator)
    step = next(steps)
    while step.field is None:
        yield step
        stop = yield Progress("training", step.fraction)
        step = steps.send(stop)
    yield step
    return step.field
