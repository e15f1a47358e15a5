"""Numbers that requests refuse."""

import math

from nerfnav.errors import InvalidInputError


def require_positive(**numbers: float | None) -> None:
    """Raise InvalidInputError, which names it, for a number that is not finite and above 0; None is not asked for."""
    for name, number in numbers.items():
        if number is not None and not 0 < number < math.inf:
            raise InvalidInputError(f"{name} must be a number above 0, not {number:g}")


def require_not_negative(**numbers: float | None) -> None:
    """Raise InvalidInputError, which names it, for a number that is not finite and at least 0; None is not asked for.
    """
    for name, number in numbers.items():
        if number is not None and not 0 <= number < math.inf:
            raise InvalidInputError(f"{name} must be a number, at least 0, not {number:g}")


def require_probability(**numbers: float | None) -> None:
    """Raise InvalidInputError, which names it, for a number not above 0 and at most 1; None is not asked for."""
    for name, number in numbers.items():
        if number is not None and not 0 < number <= 1:
            raise InvalidInputError(f"{name} must be a probability, above 0 and at most 1, not {number:g}")
