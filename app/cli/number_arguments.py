"""Several numbers in a row as an argument of a command line."""

import math
from collections.abc import Callable
from typing import Any

from tyro.constructors import PrimitiveConstructorSpec


def numbers(words: list[str], what: str) -> tuple[float, ...]:
    """The numbers that words stand for, with spaces or commas between them.

    Raises ValueError, which names `what` they are, for all but finite numbers.
    """
    try:
        read = tuple(float(part) for word in words for part in word.split(","))
    except ValueError:
        raise ValueError(f"{what} is made of numbers, not of {' '.join(words)!r}") from None
    if not all(math.isfinite(number) for number in read):
        raise ValueError(f"{what} is made of finite numbers, not of {' '.join(words)}")
    return read


def counted(what: str, count: int, words: list[str]) -> tuple[float, ...]:
    """So many numbers. Raises ValueError, which names `what` they are, for more or less of them."""
    read = numbers(words, what)
    if len(read) != count:
        raise ValueError(f"{what} takes {count} numbers, not {len(read)}")
    return read


def in_words(metavar: str, read: Callable[[list[str]], tuple[float, ...]]) -> PrimitiveConstructorSpec[Any]:
    """How tyro makes an argument, None where it is not given, of words that help calls `metavar`."""
    return PrimitiveConstructorSpec(
        nargs="*",
        metavar=metavar,
        instance_from_str=read,
        is_instance=lambda value: value is None or isinstance(value, tuple),
        str_from_instance=lambda value: [] if value is None else [f"{number:g}" for number in value],
    )
