"""Comparison: the speed-up of one method over another, both timed in one run."""

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Comparison:
    """Two ways to the same result."""

    name: str
    """What both do: plan, replan, filter, render or train_step."""
    paper_ms: float
    """Median time of the paper's way, in plain torch [ms]."""
    fast_ms: float
    """Median time of nerfnav's way [ms]."""
    threads: int
    """Threads that both had."""
    detail: dict[str, float]
    """What else was measured, each name with its unit: how alike the results are, among others."""

    @property
    def ratio(self) -> float:
        """Speed of nerfnav in those of the paper's way."""
        return self.paper_ms / self.fast_ms


def time_interleaved(
    paper: Callable[[], object], fast: Callable[[], object], rounds: int, fast_per_round: int = 1
) -> tuple[float, float]:
    """Median times [ms] of two calls made in turn, so that a busy moment of the machine strikes both.

    The fast one is called `fast_per_round` times in each round. Warm both up before.
    """
    slow_ms, fast_ms = [], []
    for _ in range(rounds):
        slow_ms.append(milliseconds(paper))
        fast_ms += [milliseconds(fast) for _ in range(fast_per_round)]
    return statistics.median(slow_ms), statistics.median(fast_ms)


def median_ms(call: Callable[[], object], repeats: int) -> float:
    """Median time of a call [ms], which is made once before to warm it up."""
    call()
    return statistics.median(milliseconds(call) for _ in range(repeats))


def milliseconds(call: Callable[[], object]) -> float:
    """Time a call [ms]."""
    begun = time.perf_counter()
    call()
    return 1e3 * (time.perf_counter() - begun)
