"""Generators of steps: run one to its end, convert its steps, or yield its result as the last step.

A long computation yields steps while it runs and returns its result: `Generator[Step, Sent, Result]`. What is sent to
it, such as a wish to stop, is optional.
"""

from collections.abc import Callable, Generator, Iterator
from typing import Any, TypeVar

Step = TypeVar("Step")
Converted = TypeVar("Converted")
Result = TypeVar("Result")


def run_steps(steps: Generator[Any, Any, Result]) -> Result:
    """Run a generator to its end, ignore its steps, and return its result."""
    while True:
        try:
            next(steps)
        except StopIteration as end:
            return end.value


def map_steps(
    steps: Generator[Step, Any, Result], convert: Callable[[Step], Converted]
) -> Generator[Converted, Any, Result]:
    """Yield each step of a generator converted, pass on what is sent, and return the generator's result."""
    sent: Any = None
    while True:
        try:
            step = steps.send(sent)
        except StopIteration as end:
            return end.value
        sent = yield convert(step)


def yield_result(steps: Generator[Step, None, Result]) -> Iterator[Step | Result]:
    """Yield the steps of a generator, then its result."""
    yield (yield from steps)
