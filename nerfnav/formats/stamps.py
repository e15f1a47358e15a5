"""Stamped lists in text: TUM's rgb.txt, depth.txt and groundtruth.txt, EuRoC's data.csv; and the units of stamps.

A row is a stamp and more cells, which spaces, tabs, commas or semicolons part. Lines that begin with # are comments,
and so is a first row that begins with "time...", the heading of a table. Stamps since 1970 are in s, ms, us or ns, as
their magnitude tells; others are in the unit of their format.
"""

import math
import re
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import NamedTuple

from nerfnav.core.errors import InvalidInputError
from nerfnav.formats.record import printable, read_text

_NUMBER = re.compile(r"[+-]?[0-9]{1,40}(\.[0-9]*)?([eE][+-]?[0-9]{1,2})?")
_BREAK = re.compile(r"\s*[,;]\s*|\s+")
_SINCE_1970 = (1e9, 2e9)
"""Seconds since 1970 of the years 2001 to 2033."""
_UNITS = (1.0, 1e3, 1e6, 1e9)
"""Stamps in a second: s, ms, us, ns."""
_USUAL_S = 0.03
"""Usual time between two rows [s]: cameras and inertial units take 10 to 1000 in a second."""
_LONGEST_NAME = 1024


class Row(NamedTuple):
    """One row of a list."""

    where: str
    """Line and file, for messages."""
    cells: list[str]
    """Stamp and what follows."""


def read_rows(path: Path, columns: int, named: bool = False) -> list[Row]:
    """Read the rows of a list; with `named`, the last of the columns is a file's name, which may have spaces.

    Raises InvalidInputError for a file that is no text, and for a row with fewer columns or a name of no file.
    """
    rows: list[Row] = []
    for number, line in enumerate(read_text(path).splitlines(), 1):
        line = line.strip().rstrip(",;")
        cells = [cell.strip("\"'") for cell in _BREAK.split(line, columns - 1 if named else 0)]
        if not line or line.startswith("#") or (not rows and cells[0].lower().startswith("time")):
            continue
        if len(cells) < columns:
            raise InvalidInputError(
                f"line {number} of {path} has {len(cells)} columns, where {columns} are needed: {printable(line)!r}"
            )
        if named and (len(cells[-1]) > _LONGEST_NAME or not cells[-1].isprintable()):
            raise InvalidInputError(f"line {number} of {path} names {printable(cells[-1])!r}, which no file is called")
        rows.append(Row(f"line {number} of {path}", cells))
    return rows


def parse_number(text: str, where: str) -> float:
    """Parse a cell. Raises InvalidInputError for what is no finite number."""
    number = float(text) if _NUMBER.fullmatch(text) else math.nan
    if not math.isfinite(number):
        raise InvalidInputError(f"{where} has {printable(text)!r} where a number should be")
    return number


def parse_stamp(text: str, where: str) -> float:
    """Parse a stamp [s]: since 1970 in the unit of its magnitude, otherwise in s. Raises InvalidInputError for none."""
    return _seconds(text, stamps_in_second(parse_number(text, where)) or 1.0)


def parse_nanoseconds(rows: Sequence[Row]) -> list[float]:
    """Parse the stamps [s] of a table in ns, or in another unit since 1970 where rows would follow too fast in ns.

    Raises InvalidInputError for a stamp that is no number.
    """
    stamps = [parse_number(row.cells[0], row.where) for row in rows]
    unit = (stamps_in_second(stamps[0]) or 1.0) if stamps else 1e9
    step = median(later - stamp for stamp, later in pairwise(stamps)) if len(stamps) > 1 else 0.0
    if step > 0:
        unit = min(1e9, unit, key=lambda each: abs(math.log(step / each / _USUAL_S)))
    return [_seconds(row.cells[0], unit) for row in rows]


def stamps_in_second(stamp: float) -> float | None:
    """Stamps in a second, for a stamp since 1970; None for another one."""
    return next((unit for unit in _UNITS if _SINCE_1970[0] <= stamp / unit < _SINCE_1970[1]), None)


def _seconds(text: str, unit: float) -> float:
    """Seconds of a stamp; a whole number is divided exactly."""
    return (int(text) if text.isdecimal() else float(text)) / unit


def time_in_name(name: str) -> float | None:
    """Time [s] that the name of a picture tells; None for one that counts pictures.

    It is a number with a point (TUM: 1305031102.175304), or one since 1970 in s, ms, us or ns, or one of 16 digits and
    more in ns (ROS, EuRoC, simulators: 0000000050000000000).
    """
    if not re.fullmatch(r"[0-9]{1,40}(\.[0-9]+)?", name):
        return None
    unit = stamps_in_second(float(name)) or (1.0 if "." in name else 1e9 if len(name) >= 16 else None)
    return None if unit is None else _seconds(name, unit)
