"""PLY files of splats: a header of text, then rows of numbers, element by element; SuperSplat's compression.

SuperSplat's compressed .ply packs chunks of 256 splats between the chunk's smallest and largest values: positions and
logarithms of standard deviations in 11, 10, 11 bits, colour and opacity in 4 times 8, and the quaternion as the
number of its largest part (2 bits) and the three others in 10 bits each from -1/sqrt(2) to 1/sqrt(2).
"""

import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from nerfnav.core.errors import InvalidInputError
from nerfnav.importers.splats.gaussians import Splats, clean_splats, from_smallest_three

_TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": "<"}
"""Format, as the header says it, to the order of bytes."""

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
    """All tables of a PLY file, as structured arrays by name; lists end the reading.

    Raises InvalidInputError where the file is no PLY or holds fewer rows than it declares.
    """
    with path.open("rb") as file:
        elements, length, form = _header(file, path)
    if form == "ascii":
        return _read_text(path, elements, length)
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


def _read_text(path: Path, elements: list[Element], length: int) -> dict[str, np.ndarray]:
    """Read the tables of a PLY file of text, a row a line."""
    lines = path.read_bytes()[length:].split(b"\n")
    tables: dict[str, np.ndarray] = {}
    for element in elements:
        if any(kind == "list" for _, kind in element.columns):
            break
        if not element.columns:
            raise InvalidInputError(f"{path} is a PLY file in the format ascii whose {element.name!r} has no columns")
        rows, lines = lines[: element.count], lines[element.count :]
        try:
            # all as floats: "255.0" is a byte, too
            numbers = np.loadtxt(rows, np.float64, comments=None, ndmin=2) if rows else np.empty((0, 0))
        except ValueError as error:
            raise InvalidInputError(f"{path} has a row of {element.name!r} that is no row of numbers") from error
        if numbers.shape != (element.count, len(element.columns)) and element.count:
            raise InvalidInputError(
                f"{path} is truncated: its header declares {element.count} rows of {len(element.columns)} numbers of "
                f"{element.name!r}, but there are {numbers.shape[0]} of {numbers.shape[1]}"
            )
        tables[element.name] = np.zeros(element.count, np.dtype(list(element.columns)))
        with np.errstate(invalid="ignore", over="ignore"):
            for column, (name, _) in enumerate(element.columns):
                tables[element.name][name] = numbers[:, column]
    return tables


def ply_columns(path: Path | bytes) -> dict[str, tuple[str, ...]]:
    """Names of the properties of each table, from the header alone: of a file, or of its beginning."""
    if isinstance(path, bytes):
        elements = _header(io.BytesIO(path), Path())[0]
    else:
        with path.open("rb") as file:
            elements = _header(file, path)[0]
    return {element.name: tuple(name for name, _ in element.columns) for element in elements}


LONGEST_HEADER = 1 << 16
"""Bytes in which a header ends."""


def _header(file: io.BufferedIOBase, path: Path) -> tuple[list[Element], int, str]:
    """The tables that a file's header declares, how many bytes it has, and the format."""
    start = file.read(LONGEST_HEADER)
    end = start.find(b"end_header")
    if not start.startswith(b"ply") or end < 0:
        raise InvalidInputError(f"{path} is not a PLY file, or its header is cut off")
    newline = start.find(b"\n", end)
    if newline < 0:
        raise InvalidInputError(f"{path} is truncated: it ends in its header")
    lines = [line.split() for line in start[:end].decode("ascii", errors="replace").splitlines()[1:]]
    form = next((line[1] for line in lines if line[:1] == ["format"] and len(line) > 1), "unknown")
    if form not in _ORDERS:
        raise InvalidInputError(f"{path} is a PLY file in the format {form}; known are {', '.join(_ORDERS)}")
    elements: list[Element] = []
    try:
        for line in lines:
            if line[:1] == ["element"]:
                elements.append(Element(line[1], _count(line[2]), ()))
            elif line[:1] == ["property"]:
                last = elements[-1]
                kind = "list" if line[1] == "list" else _ORDERS[form] + _TYPES[line[1]]
                if line[-1] in dict(last.columns):
                    raise ValueError("two properties of one name")
                elements[-1] = Element(last.name, last.count, (*last.columns, (line[-1], kind)))
    except (IndexError, KeyError, ValueError) as error:
        raise InvalidInputError(f"{path} has a PLY header that makes no sense") from error
    return elements, newline + 1, form


def _count(word: str) -> int:
    count = int(word)
    if count < 0:
        raise ValueError("a negative count")
    return count


NEEDED = (
    "x", "y", "z", "opacity", "scale_0", "scale_1", "rot_0", "rot_1", "rot_2", "rot_3",
)  # fmt: skip
HARMONICS, RGB = ("f_dc_0", "f_dc_1", "f_dc_2"), ("red", "green", "blue")
THIRD_SCALE = "scale_2"
PACKED = ("packed_position", "packed_rotation", "packed_scale", "packed_color")
"""Properties of vertices that are splats: these, and a colour; the third scale is missing where they are discs."""


def is_splat_header(ply: Path | bytes) -> bool:
    """True for a PLY file, or its beginning, whose vertices have the properties of splats."""
    try:
        columns = set(ply_columns(ply).get("vertex", ()))
    except (InvalidInputError, OSError):
        return False
    coloured = columns.issuperset(HARMONICS) or columns.issuperset(RGB)
    return (columns.issuperset(NEEDED) and coloured) or columns.issuperset(PACKED)


_CHUNK = 256


def decode_compressed(path: Path, chunks: np.ndarray, vertices: np.ndarray) -> Splats:
    if len(chunks) != -(-len(vertices) // _CHUNK):
        raise InvalidInputError(
            f"{path} has {len(chunks)} chunks for {len(vertices)} splats, and {-(-len(vertices) // _CHUNK)} are needed"
        )
    needed = [f"{end}_{name}" for end in ("min", "max") for name in ("x", "y", "z", "scale_x", "scale_y", "scale_z")]
    needed += [f"max_{name}" for name in "rgb" if f"min_{name}" in (chunks.dtype.names or ())]
    missing = [name for name in needed if name not in (chunks.dtype.names or ())]
    missing += [name for name in PACKED if vertices.dtype[name].newbyteorder("=") != np.uint32]
    if missing:
        raise InvalidInputError(f"{path} has no {', '.join(missing)}, as compressed splats have")
    chunk = np.arange(len(vertices)) // _CHUNK

    def between(shares: np.ndarray, *names: str) -> np.ndarray:
        if f"min_{names[0]}" not in (chunks.dtype.names or ()):
            return shares  # older files have colours from 0 to 1
        lower = columns_of(chunks, *(f"min_{name}" for name in names))[chunk]
        upper = columns_of(chunks, *(f"max_{name}" for name in names))[chunk]
        return lower + shares * (upper - lower)

    color = _unpacked(vertices["packed_color"], (24, 8), (16, 8), (8, 8), (0, 8))
    smaller = (_unpacked(vertices["packed_rotation"], (20, 10), (10, 10), (0, 10)) - 0.5) * np.sqrt(2)
    log_scales = between(_unpacked(vertices["packed_scale"], *_11_10_11), "scale_x", "scale_y", "scale_z")
    return clean_splats(
        between(_unpacked(vertices["packed_position"], *_11_10_11), "x", "y", "z"),
        np.exp(log_scales.clip(None, 30)),
        from_smallest_three(smaller, (vertices["packed_rotation"] >> 30).astype(np.int64)),
        between(color[:, :3], "r", "g", "b"),
        color[:, 3],
    )


_11_10_11 = ((21, 11), (11, 10), (0, 11))


def _unpacked(words: np.ndarray, *parts: tuple[int, int]) -> np.ndarray:
    """Shares in [0, 1] of the parts (lowest bit, number of bits) of 32-bit words."""
    return np.stack([((words >> low) & ((1 << bits) - 1)) / ((1 << bits) - 1) for low, bits in parts], 1)


def columns_of(table: np.ndarray, *names: str) -> np.ndarray:
    return np.stack([table[name].astype(np.float64) for name in names], 1)
