"""Training progress: the share that is done, the current error, and the speed."""

import time
from dataclasses import dataclass

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


class Progress:
    """Counts training steps against a number of them, or against the time since it was made."""

    def __init__(self, iterations: int, seconds: float | None) -> None:
        """Count `iterations` steps, or `seconds` of time where these are given."""
        self.iteration = 0
        self.fraction = 0.0
        """Share of the training that is done, 0 to 1."""
        self._iterations, self._seconds, self._rays = iterations, seconds, 0
        self._begun, self._error = time.perf_counter(), 0.0

    @property
    def elapsed_s(self) -> float:
        """Time since the first training step ended [s]."""
        return time.perf_counter() - self._begun

    @property
    def psnr_db(self) -> float:
        """Of recent training rays [dB]."""
        return psnr_db(self._error)

    @property
    def rays_per_s(self) -> float:
        """Rays learned from in a second, since the beginning."""
        return self._rays / self.elapsed_s

    def learned(self, loss: float, rays: int) -> None:
        """After a training step with this mean squared error on so many rays.

        Time counts from the end of the first one, in which kernels may be compiled.
        """
        if self.iteration == 0:
            self._begun = time.perf_counter()
        else:
            self._rays += rays
        self._error = loss if self.iteration == 0 else _FORGET * self._error + (1 - _FORGET) * loss
        self.iteration += 1
        done = self.iteration / self._iterations if self._seconds is None else self.elapsed_s / self._seconds
        self.fraction = min(1.0, done)

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
