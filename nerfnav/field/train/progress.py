"""Training progress: the share that is done, the current error, and the speed."""

import time

from nerfnav.geometry import psnr_db

_FORGET = 0.98
"""Share of the running error that a training step keeps."""


class Progress:
    """Counts training steps against a number of them, or against the time since it was made."""

    def __init__(self, iterations: int, seconds: float | None) -> None:
        """`seconds` replaces `iterations`."""
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

    @property
    def seconds_left(self) -> float:
        """Estimated time to the end [s]."""
        return self.elapsed_s * (1 - self.fraction) / self.fraction

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

    def is_due(self, every: int) -> bool:
        """Whether to report, which is done every so many steps until the last one."""
        return self.iteration % every == 0 and self.fraction < 1
