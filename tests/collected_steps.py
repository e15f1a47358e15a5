"""Steps of a generator, with its result."""

from collections.abc import Generator
from typing import Any, TypeVar

Step = TypeVar("Step")
Result = TypeVar("Result")


def collect(steps: Generator[Step, Any, Result]) -> tuple[list[Step], Result]:
    """All steps of a generator, and what it returns."""
    found: list[Step] = []
    while True:
        try:
            found.append(next(steps))
        except StopIteration as end:
            return found, end.value
