"""How long lasting work takes, what its consumer does between its steps left out."""

from collections.abc import Callable, Generator, Iterator
from time import perf_counter
from typing import TypeVar

Step = TypeVar("Step")


def timed(
    steps: Iterator[Step], clock: Callable[[], float] = perf_counter
) -> Generator[Step, None, tuple[Step, float]]:
    """Pass all steps on; returns the last one and the time that the work took [ms] by a clock [s]."""
    spent, last = 0.0, None
    while True:
        began = clock()
        step = next(steps, None)
        spent += clock() - began
        if step is None:
            break
        last = step
        yield step
    assert last is not None, "lasting work yields at least one step"
    return last, 1e3 * spent
