"""Exceptions for misuse: each message is one sentence that says what was wrong and what would be right.

Outcomes that a correct call may have (no path, diverged, hit) are enum members of the result, never exceptions.
"""

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from os import PathLike
from pathlib import Path

_LONG_WORD = re.compile(r"(\S{100})\S{300,}(\S{100})")


class NerfnavError(Exception):
    """Base of all errors that nerfnav raises on purpose; the message is meant for the user as it stands."""

    def __str__(self) -> str:
        return _LONG_WORD.sub(r"\1…\2", super().__str__())  # names and numbers in damaged files have any length


class InvalidInputError(NerfnavError):
    """A value that cannot be worked with: NaN, a wrong shape, an empty range."""


class InvalidNumberError(InvalidInputError):
    """A number out of its range. The command line names the option where the message names the field."""

    def __init__(self, name: str, wanted: str, number: float) -> None:
        """Say what the field called `name` must be in place of `number`."""
        super().__init__(name, wanted, number)
        self.name, self.wanted, self.number = name, wanted, number

    def __str__(self) -> str:
        return f"{self.name} must be {self.wanted}, not {self.number:g}"


class UnknownNameError(NerfnavError):
    """A name that is not among the known ones, which the message lists."""

    def __init__(self, kind: str, name: str, known: Iterable[str]) -> None:
        """Say that `name` is no `kind`, and list what is `known`."""
        super().__init__(f"there is no {kind} named {name!r}; known are: {', '.join(sorted(known))}")


class NameTakenError(NerfnavError):
    """A name under which something else is registered already."""

    def __init__(self, kind: str, name: str) -> None:
        """Say that there is a `kind` of that `name`."""
        super().__init__(f"there is a {kind} named {name!r} already: give yours another name")


class FieldFileError(NerfnavError):
    """A file that is not a readable nerfnav field."""


class OutsideBoxError(NerfnavError):
    """A point outside the box of the field."""


class OccupiedError(NerfnavError):
    """A start or goal in occupied space; `nearest` is the nearest free point [m], or None where none was found."""

    def __init__(
        self, name: str, place: str, reason: str, advice: str, nearest: tuple[float, float, float] | None
    ) -> None:
        """Say that the end of this name ("start", "goal") at a place is unfit for a reason, and give advice."""
        super().__init__(f"the {name} {place} {reason}; {advice}")
        self.name, self.nearest = name, nearest
        self._place, self._advice = place, advice

    def because(self, reason: str) -> "OccupiedError":
        """Return the same error for another reason."""
        return OccupiedError(self.name, self._place, reason, self._advice, self.nearest)


class MissingExtraError(NerfnavError):
    """An optional dependency that is needed and not installed."""

    def __init__(self, user: str, package: str, extra: str) -> None:
        """Say that `user` needs `package`, and which extra of nerfnav brings it."""
        super().__init__(f"{user} needs {package}, which is not installed here: pip install 'nerfnav[{extra}]'")


@contextmanager
def naming_input(source: str | PathLike[str]) -> Iterator[None]:
    """Put the name of an input file or folder before the message of an error within that does not name it.

    Errors that name an option, InvalidNumberError, stay as they are.
    """
    try:
        yield
    except InvalidInputError as error:
        if not isinstance(error, InvalidNumberError) and Path(source).absolute().name not in str(error):
            error.args = (f"{source}: {error}",)
        raise


def require_positive(**numbers: float | None) -> None:
    """Raise InvalidNumberError, which names it, for a number that is not finite and above 0; None passes."""
    _require(numbers, lambda number: 0 < number < math.inf, "a number above 0")


def require_not_negative(**numbers: float | None) -> None:
    """Raise InvalidNumberError, which names it, for a number that is not finite and at least 0; None passes."""
    _require(numbers, lambda number: 0 <= number < math.inf, "a number, at least 0")


def require_probability(**numbers: float | None) -> None:
    """Raise InvalidNumberError, which names it, for a number not above 0 and at most 1; None passes."""
    _require(numbers, lambda number: 0 < number <= 1, "a probability, above 0 and at most 1")


def require_share(**numbers: float | None) -> None:
    """Raise InvalidInputError, which names it, for a number not from 0 to 1; None passes."""
    _require(numbers, lambda number: 0 <= number <= 1, "a share, from 0 to 1")


def require_seed(**numbers: float | None) -> None:
    """Raise InvalidNumberError, which names it, for a seed that random generators do not take; None passes."""
    _require(numbers, lambda number: 0 <= number < 2**32, "from 0 to 4294967295")


def _require(numbers: Mapping[str, float | None], is_valid: Callable[[float], bool], wanted: str) -> None:
    for name, number in numbers.items():
        if number is not None and not is_valid(number):
            raise InvalidNumberError(name, wanted, number)


_LONGEST = 160


def first_line(error: BaseException) -> str:
    """Take the first line of a foreign reader's message, shortened; the exception's type where it is empty."""
    lines = str(error).strip().splitlines() or [type(error).__name__]
    return lines[0][:_LONGEST]
