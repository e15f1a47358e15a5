"""Exposure compensation while a field is learned: the gains of its photographs are looked for again and again."""

import torch

from nerfnav.compiled import default_threads, threads
from nerfnav.field.exposure import QUARTERS, gains
from nerfnav.field.learner import GridLearner
from nerfnav.field.rays import RaySampler
from nerfnav.field.torch_learner import TorchLearner

_EVERY = 0.08
"""Share of the training between two looks."""
_RAYS = 128
"""Rays of each quarter of each photograph that are looked along."""


class ExposureLooks:
    """Tells a sampler of training rays the gains of its photographs, as far as they are known by then."""

    def __init__(self, sampler: RaySampler, wanted: bool) -> None:
        """Unless `wanted`, all gains stay 1."""
        self._sampler, self._next = sampler, _EVERY if wanted else torch.inf

    def look(self, learner: GridLearner | TorchLearner, fraction: float) -> None:
        """Correct the sampler by what the learner shows, if it is time to: `fraction` of the training is done."""
        if fraction < self._next:
            return
        self._next = fraction + _EVERY
        with threads(default_threads()):
            batch = self._sampler.draw_quarters(_RAYS)
            colors = (torch.from_numpy(batch.targets), learner.colors(batch))
        taken, shown = (part.reshape(-1, QUARTERS, _RAYS, 3) for part in colors)
        self._sampler.correct(gains(taken, shown))
