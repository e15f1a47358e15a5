"""Times of a source: they must go on."""

from nerfnav.errors import InvalidInputError


def after(time: float, last: float | None, what: str) -> float:
    """`time` [s], if it is a number after `last`; `what` was taken then, for people. Raises InvalidInputError."""
    if not (time > float("-inf") if last is None else time > last):
        before = "no earlier one" if last is None else f"{last:.6f} s"
        raise InvalidInputError(f"time must go on: {what} was taken at {time:.6f} s, and the one before at {before}")
    return time
