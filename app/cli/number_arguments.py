"""Numbers as arguments of a command line: finite ones alone, and several in a row."""

import math
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from functools import partial
from typing import Any

from tyro.constructors import PrimitiveConstructorSpec

from nerfnav.core.errors import InvalidInputError


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


def parse_count(what: str, count: int, words: list[str]) -> tuple[float, ...]:
    """So many numbers. Raises ValueError, which names `what` they are, for more or less of them."""
    read = numbers(words, what)
    if len(read) != count:
        raise ValueError(f"{what} takes {count} numbers, not {len(read)}")
    return read


def numbers_argument(what: str, metavar: str) -> PrimitiveConstructorSpec[Any]:
    """How tyro makes an argument called `what` of as many numbers as `metavar` has words; None where not given."""
    return words_argument(metavar, partial(parse_count, what, len(metavar.split())))


def words_argument(metavar: str, read: Callable[[list[str]], tuple[float, ...]]) -> PrimitiveConstructorSpec[Any]:
    """How tyro makes an argument, None where it is not given, of words that help calls `metavar`."""
    return PrimitiveConstructorSpec(
        nargs="*",
        metavar=metavar,
        instance_from_str=read,
        is_instance=lambda value: value is None or isinstance(value, tuple),
        str_from_instance=lambda value: [] if value is None else [f"{number:g}" for number in value],
    )


def require_finite(arguments: Any, prefix: str = "--") -> None:
    """Refuse NaN and infinity wherever a number can be given."""
    for entry in fields(arguments):
        value, name = getattr(arguments, entry.name), prefix + entry.name.replace("_", "-")
        if is_dataclass(value):
            require_finite(value, f"{name}.")
        elif isinstance(value, float) and not math.isfinite(value):
            raise InvalidInputError(f"{name} must be a finite number, not {value}")
