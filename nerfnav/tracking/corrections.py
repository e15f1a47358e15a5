"""What a picture makes of a prediction: by the filter of real pictures, or by that of flights."""

from collections import deque
from collections.abc import Callable

import torch
from torch import Tensor

from nerfnav.estimator import AlignedFilter, Belief, FastFilter, FilterStep, ProcessNoise
from nerfnav.field import Field
from nerfnav.geometry import Camera, Pose
from nerfnav.robots import Robot
from nerfnav.tracking.tracker_config import TrackerConfig

Correction = Callable[[Belief, Tensor, torch.Generator, ProcessNoise, int], FilterStep]
"""The last step of an update: from a prediction, a picture, random draws, the process noise that is in the prediction,
and from how many starts (which the filter of flights decides by itself)."""


def correction(field: Field, robot: Robot, camera: Camera, mount: Pose, config: TrackerConfig) -> Correction:
    """As `config` says."""
    if config.align is not None:
        return AlignedFilter(field, camera, mount, config.filter, config.align).correct
    fast = FastFilter(field, robot, camera, mount, config.filter)

    def last_step(
        prediction: Belief, picture: Tensor, generator: torch.Generator, noise: ProcessNoise, _starts: int
    ) -> FilterStep:
        return deque(fast.correct(prediction, picture, generator, noise), maxlen=1).pop()

    return last_step
