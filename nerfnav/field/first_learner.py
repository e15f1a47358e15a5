"""What learns the first stage of a training, and what is known before it."""

from typing import NamedTuple

import torch
from jaxtyping import Bool
from torch import Tensor

from nerfnav.field.fusion import Fused, fused
from nerfnav.field.hull import hull, widened
from nerfnav.field.learned_place import Place
from nerfnav.field.learner import GridLearner
from nerfnav.field.torch_learner import TorchLearner
from nerfnav.field.train_config import TrainConfig
from nerfnav.field.trainable import require_memory, require_trainable
from nerfnav.geometry import Box, PosedImages


class FirstLearner(NamedTuple):
    """Where training begins."""

    learner: GridLearner | TorchLearner
    """Kernels on the processor, torch elsewhere."""
    stage: int
    """The stage that it is for."""
    told: Fused | None
    """What depths tell of where things are; None without depths."""
    asked: Bool[Tensor, "n height width"] | None = None
    """Which pixels there is something to learn from; None: all."""


def first_learner(
    photographs: PosedImages, box: Box, background: torch.Tensor, config: TrainConfig, workers: int
) -> FirstLearner:
    """What learns at first, on `workers` threads.

    Raises InvalidInputError for images that no field can be learned from, and where memory cannot hold the training.
    """
    require_trainable(photographs, box)
    last = len(config.stages) - 1
    require_memory(config.shape(box, last), config.outside, workers)
    place = Place.of(box, background, config.voxel)
    if photographs.silhouettes is not None:
        shape = config.shape(box, 0)
        wide = widened(photographs, box, config.voxel * config.stages[0])
        learner = GridLearner.in_hull(place, hull(wide, box, shape), photographs, workers)
        return FirstLearner(_on_device(learner, config), 0, None, wide.silhouettes)
    if photographs.depth is None:
        shape, outside = config.shape(box, 0), config.nodes_outside(0)
        learner = GridLearner.start(place, shape, photographs, workers, outside)
        return FirstLearner(_on_device(learner, config), 0, None)
    # where things are is known: there is nothing to find out coarsely first
    told = fused(photographs, box, config.shape(box, last))
    learner = GridLearner.from_depth(place, told, photographs, workers, config.outside)
    return FirstLearner(_on_device(learner, config), last, told)


def _on_device(learner: GridLearner, config: TrainConfig) -> GridLearner | TorchLearner:
    device = torch.device(config.device)
    return learner if device.type == "cpu" else TorchLearner.of(learner, device)
