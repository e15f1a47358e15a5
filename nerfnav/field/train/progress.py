"""Training progress: the share that is done, the current error, and the speed."""

import math
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import UInt8

from nerfnav.core.deadline import Deadline
from nerfnav.field.models.voxel import VoxelField
from nerfnav.geometry import psnr_db

_FORGET = 0.98
"""Share of the running error that a training step keeps."""


@dataclass(frozen=True)
class TrainStep:
    """Progress of training a field."""

    iteration: int
    """Training steps done."""
    fraction: float
    """Share of the training that is done, 0 to 1."""
    psnr_db: float
    """Peak signal-to-noise ratio [dB]: of recent training rays; on the last step, of held-out views."""
    rays_per_s: float
    """Rays learned from in a second, since the start."""
    seconds_left: float
    """Estimated time to the end [s]."""
    so_far: VoxelField | None = None
    """The field so far, evaluated as the trained field is, so that one can plan in it: set every `field_every` s."""
    last: bool = False
    """Training has ended."""
    picture: UInt8[np.ndarray, "height width 3"] | None = field(default=None, compare=False, repr=False)
    """The field so far, seen from the first photograph, sRGB: set every `picture_every` s."""


_EVALUATION = 0.25
"""Share of a budget that is kept for the evaluation before its time is known."""
_LEAST = 0.1
"""Share of a budget for which training goes on, however long the evaluation takes."""


class Progress:
    """Counts training steps against a number of them, or against a budget of time."""

    def __init__(self, iterations: int, budget: Deadline, least: int = 0) -> None:
        """Count `iterations` steps, or the time of a budget where that has an end, but at least `least` steps."""
        self.iteration = 0
        self.fraction = 0.0 if iterations else 1.0
        """Share of the training that is done, 0 to 1."""
        self._iterations, self._least, self._rays, self._error = iterations, least, 0, 0.0
        self._budget, self._seconds = budget, math.inf
        self._clock = Deadline(whole=budget)

    @property
    def elapsed_s(self) -> float:
        """Time since the first training step ended [s]."""
        return self._clock.elapsed_s

    @property
    def psnr_db(self) -> float:
        """Of recent training rays [dB]."""
        return psnr_db(self._error)

    @property
    def rays_per_s(self) -> float:
        """Rays learned from in a second, since the beginning."""
        return self._rays / max(self.elapsed_s, 1e-9)

    def learned(self, loss: float, rays: int) -> None:
        """After a training step with this mean squared error on so many rays.

        Speed counts from the end of the first one, in which kernels may be compiled.
        """
        if self.iteration == 0:
            self._clock = Deadline(whole=self._budget)
            self.reserve(_EVALUATION * self._budget.seconds)
        else:
            self._rays += rays
        self._error = loss if self.iteration == 0 else _FORGET * self._error + (1 - _FORGET) * loss
        self.iteration += 1
        if self.has_budget:
            done = min(self.elapsed_s / self._seconds, self.iteration / max(self._least, 1))
        else:
            done = self.iteration / self._iterations
        self.fraction = min(1.0, done)

    @property
    def has_budget(self) -> bool:
        """Check that time ends the training."""
        return math.isfinite(self._budget.seconds)

    def reserve(self, seconds: float) -> None:
        """Keep so much of the budget for the evaluation [s]; without a budget, nothing changes."""
        if self.has_budget:
            more = max(self._budget.left_s - seconds, _LEAST * self._budget.seconds)
            self._seconds = self.elapsed_s + more

    def step(self) -> TrainStep:
        """Make a step before the last."""
        seconds_left = self.elapsed_s * (1 - self.fraction) / self.fraction
        return TrainStep(self.iteration, self.fraction, self.psnr_db, self.rays_per_s, seconds_left)

    def last_step(self, psnr_db: float, rays_per_s: float) -> TrainStep:
        """Make the last step, with the PSNR of held-out views [dB] and the speed before the evaluation."""
        return TrainStep(self.iteration, self.fraction, psnr_db, rays_per_s, 0.0, last=True)

    def is_due(self, every: int) -> bool:
        """Check that a report is due: every so many steps until the last one."""
        return self.iteration % every == 0 and self.fraction < 1
