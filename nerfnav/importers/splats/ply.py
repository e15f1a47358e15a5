"""Binary PLY files, as far as splats need them: a header of text, then rows of numbers, element by element."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from nerfnav.core.errors import InvalidInputError

_TYPES = {
    **dict.fromkeys(("char", "int8"), "<i1"),
    **dict.fromkeys(("uchar", "uint8"), "<u1"),
    **dict.fromkeys(("short", "int16"), "<i2"),
    **dict.fromkeys(("ushort", "uint16"), "<u2"),
    **dict.fromkeys(("int", "int32"), "<i4"),
    **dict.fromkeys(("uint", "uint32"), "<u4"),
    **dict.fromkeys(("float", "float32"), "<f4"),
    **dict.fromkeys(("double", "float64"), "<f8"),
}
_LONGEST_HEADER = 1 << 16


@dataclass(frozen=True)
class Element:
    """One table of a PLY file."""

    name: str
    """Such as "vertex"."""
    count: int
    """Rows that the header declares."""
    columns: tuple[tuple[str, str], ...]
    """Name and numpy type of each property; a list has the type "list"."""


def read_ply(path: Path) -> dict[str, np.ndarray]:
    """All tables of a binary little-endian PLY file, as structured arrays by name; lists end the reading.

    Raises InvalidInputError where the file is no such PLY or holds fewer rows than it declares.
    """
    with path.open("rb") as file:
        start = file.read(_LONGEST_HEADER)
    elements, length = _header(path, start)
    tables: dict[str, np.ndarray] = {}
    left = path.stat().st_size - length
    for element in elements:
        if any(kind == "list" for _, kind in element.columns):
            break
        row = np.dtype(list(element.columns))
        if element.count * row.itemsize > left:
            raise InvalidInputError(
                f"{path} is truncated: its header declares {element.count} rows of {element.name!r}, "
                f"but there are {left // max(1, row.itemsize)}"
            )
        tables[element.name] = np.fromfile(path, row, element.count, offset=length)
        length, left = length + element.count * row.itemsize, left - element.count * row.itemsize
    else:
        if left:
            raise InvalidInputError(f"{path} holds {left} bytes more than its header declares: the count is wrong")
    return tables


def ply_columns(path: Path) -> dict[str, tuple[str, ...]]:
    """Names of the properties of each table, from the header alone."""
    with path.open("rb") as file:
        elements, _ = _header(path, file.read(_LONGEST_HEADER))
    return {element.name: tuple(name for name, _ in element.columns) for element in elements}


def _header(path: Path, start: bytes) -> tuple[list[Element], int]:
    """The tables that a header declares, and how many bytes it has."""
    end = start.find(b"end_header")
    if not start.startswith(b"ply") or end < 0:
        raise InvalidInputError(f"{path} is not a PLY file, or its header is cut off")
    newline = start.find(b"\n", end)
    lines = [line.split() for line in start[:end].decode("ascii", errors="replace").splitlines()[1:]]
    form = next((line[1] for line in lines if line[:1] == ["format"] and len(line) > 1), "unknown")
    if form != "binary_little_endian":
        raise InvalidInputError(f"{path} is a PLY file in the format {form}; splats come as binary_little_endian")
    elements: list[Element] = []
    try:
        for line in lines:
            if line[:1] == ["element"]:
                elements.append(Element(line[1], _count(line[2]), ()))
            elif line[:1] == ["property"]:
                last = elements[-1]
                kind = "list" if line[1] == "list" else _TYPES[line[1]]
                elements[-1] = Element(last.name, last.count, (*last.columns, (line[-1], kind)))
    except (IndexError, KeyError, ValueError) as error:
        raise InvalidInputError(f"{path} has a PLY header that makes no sense") from error
    return elements, newline + 1


def _count(word: str) -> int:
    count = int(word)
    if count < 0:
        raise ValueError("a negative count")
    return count
