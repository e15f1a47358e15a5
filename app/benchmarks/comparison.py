"""Comparison: the speed-up of one method over another, both timed in one run."""

import statistics
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TypeVar

import torch

from nerfnav.core.jit import threads

Result = TypeVar("Result")


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


@contextmanager
def both_threads(count: int = 1) -> Iterator[int]:
    """Give kernels and torch `count` threads inside the block; yields those of kernels.

    One is what planners and filters are timed with: they ask for no more.
    """
    before = torch.get_num_threads()
    try:
        with threads(count) as used:
            torch.set_num_threads(count)
            yield used
    finally:
        torch.set_num_threads(before)


def time_interleaved(
    paper: Callable[[], Result], fast: Callable[[], Result], rounds: int, fast_per_round: int = 1
) -> tuple[float, float, Result, Result]:
    """Median times [ms] and last results of two calls made in turn: a busy moment of the machine strikes both.

    The fast one is called `fast_per_round` times in each round, and once before, to be compiled.
    """
    fast()
    slow, quick = [], []
    for _ in range(rounds):
        slow.append(_timed(paper))
        quick += [_timed(fast) for _ in range(fast_per_round)]
    slow_ms, fast_ms = (statistics.median(spent for spent, _ in calls) for calls in (slow, quick))
    return slow_ms, fast_ms, slow[-1][1], quick[-1][1]


def median_ms(call: Callable[[], object], repeats: int) -> float:
    """Median time of a call [ms], which is made once before to warm it up."""
    call()
    return statistics.median(milliseconds(call) for _ in range(repeats))


def milliseconds(call: Callable[[], object]) -> float:
    """Time a call [ms]."""
    return _timed(call)[0]


def _timed(call: Callable[[], Result]) -> tuple[float, Result]:
    begun = time.perf_counter()
    result = call()
    return 1e3 * (time.perf_counter() - begun), result
