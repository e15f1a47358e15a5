"""Deadline: time budget of work in stages, of which each stage gets what the ones before it have left."""

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager


class Deadline:
    """Wall time since this was made, without pauses, against a budget of it."""

    def __init__(self, seconds: float | None = None, whole: "Deadline | None" = None) -> None:
        """Begin a budget of so many seconds; None: without an end. A part pauses as the `whole` does."""
        self.seconds = math.inf if seconds is None else seconds
        self._whole, self._paused = whole, 0.0
        self._begun = self._now()

    @property
    def elapsed_s(self) -> float:
        """Time since the beginning [s]."""
        return self._now() - self._begun

    @property
    def left_s(self) -> float:
        """Time that is left [s], negative once it is exceeded; infinite without an end."""
        return self.seconds - self.elapsed_s

    def part(self, seconds: float = math.inf) -> "Deadline":
        """Begin a part of at most so many seconds, which ends no later than the whole."""
        return Deadline(min(seconds, self.left_s), self)

    @contextmanager
    def paused(self) -> Iterator[None]:
        """Leave out the time that the block takes."""
        begun = time.perf_counter()
        try:
            yield
        finally:
            self._paused += time.perf_counter() - begun

    def _now(self) -> float:
        """Read the clock, without pauses [s]."""
        now = time.perf_counter() if self._whole is None else self._whole.elapsed_s
        return now - self._paused
