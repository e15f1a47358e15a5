"""Start and goal as words of a command line."""

from typing import Annotated

from app.cli.number_arguments import in_words, numbers
from app.places.ends import End


def _end_numbers(words: list[str]) -> tuple[float, ...]:
    read = numbers(words, "an end")
    if len(read) not in (3, 4):
        raise ValueError(f"an end is X Y Z or X Y Z YAW, not {len(read)} numbers")
    return read


EndNumbers = Annotated[tuple[float, ...] | None, in_words("X Y Z [YAW]", _end_numbers)]
"""Where a flight starts or ends, as words of a command line [m, rad]."""


def end_of(numbers: tuple[float, ...]) -> End:
    return End((numbers[0], numbers[1], numbers[2]), numbers[3] if len(numbers) == 4 else 0.0)
