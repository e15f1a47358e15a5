"""Steps of a stored flight, read from its log."""

import json
from pathlib import Path

from nerfnav.errors import InvalidInputError
from nerfnav.navigation import NavigationStep
from nerfnav_app.storage.step_codec import FILE, step_of


def count_steps(folder: Path) -> int:
    """Time steps in a log, the start not counted; 0 where there is none."""
    try:
        with (folder / FILE).open("rb") as stream:
            return max(0, sum(line.endswith(b"\n") for line in stream) - 1)
    except OSError:
        return 0


def read_steps(folder: Path, pictures: bool = True) -> tuple[NavigationStep, ...]:
    """The steps of a log; a last line that is cut off counts as not written.

    Raises InvalidInputError where there is no step, or something else than steps.
    """
    try:
        *lines, rest = (folder / FILE).read_text().split("\n")
    except (OSError, UnicodeDecodeError) as error:
        raise InvalidInputError(f"{folder.name} holds no readable log of a flight") from error
    del rest  # empty, or cut off
    try:
        steps = tuple(step_of(json.loads(line), folder if pictures else None) for line in lines)
    except (ValueError, KeyError, TypeError, RuntimeError) as error:
        raise InvalidInputError(f"the log of {folder.name} is damaged: {error}") from error
    if not steps:
        raise InvalidInputError(f"{folder.name} was cut off before its first step")
    return steps
