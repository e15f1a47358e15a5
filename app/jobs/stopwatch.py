"""How long a job really worked, whatever its consumer did between its steps."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TypeVar

Step = TypeVar("Step")


class Stopwatch:
    """Adds up the time that is spent in work."""

    def __init__(self) -> None:
        """Start at zero."""
        self.seconds = 0.0

    @contextmanager
    def running(self) -> Iterator[None]:
        """Count the time in which a block runs."""
        began = time.perf_counter()
        try:
            yield
        finally:
            self.seconds += time.perf_counter() - began

    def time(self, steps: Iterator[Step]) -> Iterator[Step]:
        """Pass steps on, counting only the time in which they are made."""
        while True:
            with self.running():
                step = next(steps, None)
            if step is None:
                return
            yield step
