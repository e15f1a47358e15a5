"""Generators of steps: run one to its end and return its result."""

from collections.abc import Generator
from typing import Any, TypeVar

Result = TypeVar("Result")


def run_steps(steps: Generator[Any, None, Result]) -> Result:
    """What a generator returns after all of its steps, for who does not look at them."""
    while True:
        try:
            next(steps)
        except StopIteration as end:
            return end.value
