"""STL, in text and binary, and OFF: meshes without textures.

OFF begins with the kinds of numbers that follow each vertex (ST, C, N: texture coordinates, colour, normal), then has
the counts of vertices, faces and edges, the vertices, and the faces with the number of their corners first.
"""

import re
from pathlib import Path

import numpy as np

from nerfnav.importers.core.kinds import decode_text
from nerfnav.importers.meshes.parts import GREY, DamagedMeshError, Part, srgb_bytes
from nerfnav.importers.meshes.polygons import triangulate
from nerfnav.importers.meshes.resolver import FolderResolver

_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def read_stl(path: Path, data: bytes, beside: FolderResolver) -> list[Part]:
    """The faces of an .stl. Raises DamagedMeshError where it is not whole."""
    count = int.from_bytes(data[80:84], "little")
    if len(data) == 84 + _FACET.itemsize * count:
        corners = np.frombuffer(data, _FACET, count, 84)["corners"].reshape(-1, 3).astype(float)
        return [_grey(corners, np.arange(len(corners)).reshape(-1, 3))]
    text = decode_text(data)
    if not text.lstrip()[:5].lower() == "solid":
        raise DamagedMeshError(
            f"is not a whole .stl file: it has {len(data)} bytes, and its header promises "
            f"{84 + _FACET.itemsize * count if len(data) >= 84 else 'at least 84'}"
        )
    if not re.search(r"^\s*endsolid\b", text, re.IGNORECASE | re.MULTILINE):
        raise DamagedMeshError("is cut off: its `endsolid` is missing")
    loops = re.findall(r"outer\s+loop\s(.*?)endloop", text, re.IGNORECASE | re.DOTALL)
    rows = [re.split(r"\bvertex\s", loop, flags=re.IGNORECASE)[1:] for loop in loops]
    try:
        points = np.array([[float(word) for word in row.split()] for loop in rows for row in loop]).reshape(-1, 3)
    except ValueError as error:
        raise DamagedMeshError("has a `vertex` without three numbers") from error
    counts = np.array([len(loop) for loop in rows], np.int64)
    corners = np.arange(len(points))
    return [_grey(points, triangulate(points, corners, counts))]


def read_off(path: Path, data: bytes, beside: FolderResolver) -> list[Part]:
    """The faces of an .off. Raises DamagedMeshError where it is not whole."""
    lines = [words for line in decode_text(data).splitlines() if (words := line.split("#", 1)[0].split())]
    kind = re.fullmatch(r"(ST)?(C)?(N)?OFF", lines[0][0].upper()) if lines else None
    if kind is None or lines[0][1:2] == ["BINARY"]:
        raise DamagedMeshError("is not an .off file in text with points of three coordinates")
    lines = ([lines[0][1:]] if len(lines[0]) > 1 else []) + lines[1:]
    try:
        points, faces = (int(word) for word in lines[0][:2])
        if points < 0 or faces < 0 or len(lines) < 1 + points + faces:
            raise DamagedMeshError(f"is cut off: it has {len(lines) - 1} rows of {points} vertices and {faces} faces")
        rows = np.array([[float(word) for word in words] for words in lines[1 : 1 + points]]).reshape(points, -1)
        polygons = [[int(word) for word in words[: 1 + int(words[0])]] for words in lines[1 + points :][:faces]]
    except (ValueError, IndexError, OverflowError) as error:
        raise DamagedMeshError("has a row that does not have the numbers that OFF needs there") from error
    if any(len(row) != 1 + row[0] for row in polygons) or rows.shape[1] < 3:
        raise DamagedMeshError("is damaged: a row has fewer numbers than it says")
    corners = np.array([corner for row in polygons for corner in row[1:]], np.int64)
    if len(corners) and not 0 <= corners.min() <= corners.max() < points:
        raise DamagedMeshError(f"has a face with a corner that does not exist: vertex {corners.max()} of {points}")
    found = corners[triangulate(rows[:, :3], corners, np.array([row[0] for row in polygons], np.int64))]
    colors = rows[:, 6 if kind[3] else 3 :][:, :3]  # those follow the normal
    if kind[2] is None or colors.shape[1] < 3:
        return [_grey(rows[:, :3], found)]
    shades = srgb_bytes(colors / 255 if colors.max(initial=0) > 1 else colors, False)
    return [Part(rows[:, :3], found, shades[found])]


def _grey(points: np.ndarray, faces: np.ndarray) -> Part:
    return Part(points, faces, np.full((len(faces), 3, 3), GREY, np.uint8))
