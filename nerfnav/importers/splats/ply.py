"""PLY files of splats: a header of text, then rows of numbers, element by element; SuperSplat's compression.

SuperSplat's compressed .ply packs chunks of 256 splats between the chunk's smallest and largest values: positions and
logarithms of standard deviations in 11, 10, 11 bits, colour and opacity in 4 times 8, and the quaternion as the
number of its largest part (2 bits) and the three others in 10 bits each from -1/sqrt(2) to 1/sqrt(2).
"""

from pathlib import Path

import numpy as np

from nerfnav.core.errors import InvalidInputError
from nerfnav.importers.core.ply_header import LONGEST_HEADER, PlyElement, PlyHeader, PlyHeaderError, parse_ply_header
from nerfnav.importers.splats.gaussians import Splats, clean_splats, from_smallest_three


def read_ply(path: Path) -> dict[str, np.ndarray]:
    """All tables of a PLY file, as structured arrays by name; lists end the reading.

    Raises InvalidInputError where the file is no PLY or holds fewer rows than it declares.
    """
    header = _read_header(path)
    if header.form == "ascii":
        return _read_text(path, header)
    tables: dict[str, np.ndarray] = {}
    length = header.size
    left = path.stat().st_size - length
    for element in header.elements:
        if _has_lists(element):
            break
        row = _row(element, header, path)
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


def _read_text(path: Path, header: PlyHeader) -> dict[str, np.ndarray]:
    """Read the tables of a PLY file of text, a row a line."""
    lines = path.read_bytes()[header.size :].split(b"\n")
    tables: dict[str, np.ndarray] = {}
    for element in header.elements:
        if _has_lists(element):
            break
        if not element.properties:
            raise InvalidInputError(f"{path} is a PLY file in the format ascii whose {element.name!r} has no columns")
        rows, lines = lines[: element.count], lines[element.count :]
        try:
            # all as floats: "255.0" is a byte, too
            numbers = np.loadtxt(rows, np.float64, comments=None, ndmin=2) if rows else np.empty((0, 0))
        except ValueError as error:
            raise InvalidInputError(f"{path} has a row of {element.name!r} that is no row of numbers") from error
        width = len(element.properties)
        if numbers.shape != (element.count, width) and element.count:
            raise InvalidInputError(
                f"{path} is truncated: its header declares {element.count} rows of {width} numbers of "
                f"{element.name!r}, but there are {numbers.shape[0]} of {numbers.shape[1]}"
            )
        tables[element.name] = np.zeros(element.count, _row(element, header, path))
        with np.errstate(invalid="ignore", over="ignore"):
            for column, entry in enumerate(element.properties):
                tables[element.name][entry.name] = numbers[:, column]
    return tables


def _read_header(path: Path) -> PlyHeader:
    """Read the header of a file. Raises InvalidInputError where it has none."""
    with path.open("rb") as file:
        start = file.read(LONGEST_HEADER)
    try:
        return parse_ply_header(start)
    except PlyHeaderError as error:
        raise InvalidInputError(f"{path} {error}") from error


def _has_lists(element: PlyElement) -> bool:
    return any(entry.length is not None for entry in element.properties)


def _row(element: PlyElement, header: PlyHeader, path: Path) -> np.dtype:
    """Type of the rows of a table. Raises InvalidInputError for two columns of one name."""
    names = [entry.name for entry in element.properties]
    if len(set(names)) < len(names):
        raise InvalidInputError(f"{path} has two properties of one name in {element.name!r}")
    return np.dtype([(entry.name, header.order + entry.kind) for entry in element.properties])


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
        header = parse_ply_header(ply) if isinstance(ply, bytes) else _read_header(ply)
    except (PlyHeaderError, InvalidInputError, OSError):
        return False
    tables = {element.name: {entry.name for entry in element.properties} for element in header.elements}
    columns = tables.get("vertex", set())
    coloured = columns.issuperset(HARMONICS) or columns.issuperset(RGB)
    return (columns.issuperset(NEEDED) and coloured) or columns.issuperset(PACKED)


_CHUNK = 256


def decode_compressed(path: Path, chunks: np.ndarray, vertices: np.ndarray) -> Splats:
    if len(chunks) != -(-len(vertices) // _CHUNK):
        raise InvalidInputError(
            f"{path} has {len(chunks)} chunks for {len(vertices)} splats, and {-(-len(vertices) // _CHUNK)} are needed"
        )
    needed = [f"{end}_{name}" for end in ("min", "max") for name in ("x", "y", "z", "scale_x", "scale_y", "scale_z")]
    colors, known = [f"{end}_{name}" for end in ("min", "max") for name in "rgb"], set(chunks.dtype.names or ())
    has_colors = not known.isdisjoint(colors)  # older files have none: there, colours go from 0 to 1
    missing = [name for name in [*needed, *(colors if has_colors else [])] if name not in known]
    missing += [name for name in PACKED if vertices.dtype[name].newbyteorder("=") != np.uint32]
    if missing:
        raise InvalidInputError(f"{path} has no {', '.join(missing)}, as compressed splats have")
    chunk = np.arange(len(vertices)) // _CHUNK

    def between(shares: np.ndarray, *names: str) -> np.ndarray:
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
        between(color[:, :3], "r", "g", "b") if has_colors else color[:, :3],
        color[:, 3],
    )


_11_10_11 = ((21, 11), (11, 10), (0, 11))


def _unpacked(words: np.ndarray, *parts: tuple[int, int]) -> np.ndarray:
    """Shares in [0, 1] of the parts (lowest bit, number of bits) of 32-bit words."""
    return np.stack([((words >> low) & ((1 << bits) - 1)) / ((1 << bits) - 1) for low, bits in parts], 1)


def columns_of(table: np.ndarray, *names: str) -> np.ndarray:
    return np.stack([table[name].astype(np.float64) for name in names], 1)
