"""PLY meshes: text and binary of both byte orders, polygons, triangle strips, colours and textures.

Names of properties vary by the program that wrote a file: vertex_index or vertex_indices, and (s, t), (u, v) or
(texture_u, texture_v); texcoord is a list of the coordinates of a face's corners.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int, Shaped

from nerfnav.importers.core.ply_header import PlyElement, PlyHeaderError, parse_ply_header
from nerfnav.importers.meshes.parts import GREY, DamagedMeshError, Part, srgb_bytes
from nerfnav.importers.meshes.polygons import triangulate
from nerfnav.importers.meshes.resolver import FolderResolver, PictureError
from nerfnav.world.surface import Image as Pixels


@dataclass(frozen=True, eq=False)
class _Column:
    values: Shaped[np.ndarray, " n"]
    """Numbers of all rows, one after the other."""
    counts: Int[np.ndarray, " r"]
    """Count of those of each row."""


_Table = dict[str, _Column]


def read_ply_mesh(path: Path, data: bytes, beside: FolderResolver) -> list[Part]:
    """The mesh of a .ply, a part for each texture. Raises DamagedMeshError for what is no PLY, or not whole."""
    try:
        header = parse_ply_header(data)
    except PlyHeaderError as error:
        raise DamagedMeshError(str(error)) from error
    elements, start = [element for element in header.elements if element.properties], header.size
    names = {element.name for element in elements if element.count}
    if not names & {"face", "tristrips"}:
        raise DamagedMeshError("holds no faces: a mesh needs triangles, points alone are not enough")
    rows = _TextRows(data[start:]) if header.form == "ascii" else _BinaryRows(data, start, header.order)
    tables = {element.name: rows.read(element) for element in elements}
    vertex = tables.get("vertex", {})
    points = _stack(vertex, "x", "y", "z")
    if points is None:
        raise DamagedMeshError("has no vertices with x, y and z")
    return _parts(points, vertex, tables, _pictures(header.textures, beside))


def _parts(points: np.ndarray, vertex: _Table, tables: dict[str, _Table], pictures: list[Pixels | None]) -> list[Part]:
    face = tables.get("face", {})
    polygons = next((face[name] for name in ("vertex_indices", "vertex_index") if name in face), None)
    if polygons is None:
        corners, counts = _unrolled(tables.get("tristrips", {}))
        face = {}
    else:
        corners, counts = polygons.values.astype(np.int64), polygons.counts
    if not len(corners):
        raise DamagedMeshError("holds no faces: a mesh needs triangles, points alone are not enough")
    if corners.min() < 0 or corners.max() >= len(points):
        wrong = corners[(corners < 0) | (corners >= len(points))][0]
        raise DamagedMeshError(f"has a face with a corner that does not exist: vertex {wrong} of {len(points)}")
    triangles = triangulate(points, corners, counts)
    row = np.repeat(np.arange(len(counts)), counts)[triangles[:, 0]]
    faces = corners[triangles]
    uv = _coordinates(vertex, face, counts, faces, triangles)
    tint = _tint(vertex, face, faces, row)
    number = face["texnumber"].values[row] if "texnumber" in face else np.zeros(len(faces), int)
    number = np.where((number >= 0) & (number < len(pictures)), number, -1).astype(int) if pictures else 0 * number - 1
    parts = []
    for index in np.unique(number):
        chosen, picture = number == index, pictures[index] if index >= 0 else None
        own = tint[chosen]
        if tint is not None and index >= 0 and uv is not None:
            own = np.full_like(own, GREY if picture is None else 255)
        parts.append(Part(points, faces[chosen], own, None if uv is None else uv[chosen], picture))
    return parts


def _coordinates(
    vertex: _Table, face: _Table, counts: np.ndarray, faces: np.ndarray, triangles: np.ndarray
) -> Float[np.ndarray, "f 3 2"] | None:
    """Texture coordinates of the corners of triangles; None where there are none."""
    listed = face.get("texcoord")
    if listed is not None and (listed.counts == 2 * counts).all():
        return listed.values.astype(float).reshape(-1, 2)[triangles]
    names = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"))
    found = (_stack(vertex, *pair) for pair in names)
    uv = next((rows for rows in found if rows is not None), None)
    return None if uv is None else uv[faces]


def _tint(vertex: _Table, face: _Table, faces: np.ndarray, row: np.ndarray) -> np.ndarray:
    """sRGB (f, 3, 3) of the corners of triangles, whose polygons are `row`: of vertices, else of faces, else grey."""
    for table, chosen in ((vertex, faces), (face, np.repeat(row[:, None], 3, 1))):
        colors = _stack(table, "red", "green", "blue")
        if colors is not None:
            largest = np.iinfo(table["red"].values.dtype).max if table["red"].values.dtype.kind in "ui" else 1
            largest = 255 if largest == 1 and colors.max(initial=0) > 1 else largest
            return srgb_bytes(colors / largest, False)[chosen]
    return np.full((len(faces), 3, 3), GREY, np.uint8)


def _stack(table: _Table, *names: str) -> Float[np.ndarray, "n k"] | None:
    """Columns of single numbers, beside each other; None where one is missing."""
    if any(name not in table or (table[name].counts != 1).any() for name in names):
        return None
    return np.stack([table[name].values.astype(float) for name in names], 1)


def _unrolled(table: _Table) -> tuple[Int[np.ndarray, " c"], Int[np.ndarray, " f"]]:
    """Corners and counts of the triangles of strips, which -1 ends."""
    column = next((table[name] for name in ("vertex_indices", "vertex_index") if name in table), None)
    if column is None:
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    ended = np.insert(column.values.astype(np.int64), np.cumsum(column.counts), -1)
    ends = np.flatnonzero(ended == -1)
    corners = []
    for start, end in zip(np.append(0, ends[:-1] + 1), ends, strict=True):
        strip = ended[start:end]
        triangles = np.stack([strip[:-2], strip[1:-1], strip[2:]], 1) if len(strip) > 2 else np.zeros((0, 3), int)
        triangles[1::2] = triangles[1::2, ::-1]
        corners.append(triangles.reshape(-1))
    flat = np.concatenate(corners)
    return flat, np.full(len(flat) // 3, 3)


def _pictures(names: list[str], beside: FolderResolver) -> list[Pixels | None]:
    """The textures that comments name; None, and a note, for those that cannot be had."""
    found: list[Pixels | None] = []
    for name in names:
        try:
            found.append(beside.picture(name))
        except PictureError as error:
            beside.note(str(error))
            found.append(None)
    return found


class _TextRows:
    """Numbers of a text file, one after the other."""

    def __init__(self, data: bytes) -> None:
        words = data.split()
        try:
            self._numbers = np.array([float(word) for word in words])
        except ValueError as error:
            raise DamagedMeshError("has a value after its header that is no number") from error
        self._at = 0

    def read(self, element: PlyElement) -> _Table:
        if all(entry.length is None for entry in element.properties):
            width = len(element.properties)
            values = self._take(element.count * width, element).reshape(-1, width)
            ones = np.ones(element.count, np.int64)
            columns = zip(element.properties, values.T, strict=True)
            return {entry.name: _Column(_cast(column, entry.kind), ones) for entry, column in columns}
        return _read_rows(element, lambda kind, count: _cast(self._take(count, element), kind))

    def _take(self, count: int, element: PlyElement) -> np.ndarray:
        found = self._numbers[self._at : self._at + count]
        if len(found) < count:
            raise DamagedMeshError(f"is cut off: its {element.count} rows of {element.name!r} are not all there")
        self._at += count
        return found


class _BinaryRows:
    """Bytes of a binary file, one row after the other."""

    def __init__(self, data: bytes, start: int, order: str) -> None:
        self._data, self._at, self._order = data, start, order

    def read(self, element: PlyElement) -> _Table:
        """The next table; at once where all lists are as long as those of the first row."""
        start, first = self._at, PlyElement(element.name, min(1, element.count), element.properties)
        lengths = {name: int(column.counts[0]) for name, column in self._read(first).items() if element.count}
        fields: list[tuple[str, str, tuple[int, ...]]] = []
        for number, entry in enumerate(element.properties):
            if entry.length is not None:
                fields.append((f"length {number}", self._order + entry.length, ()))
            fields.append((str(number), self._order + entry.kind, (lengths.get(entry.name, 0),)))
        row = np.dtype(fields)
        if start + element.count * row.itemsize <= len(self._data):
            table = np.frombuffer(self._data, row, element.count, start)
            counts = {number: lengths.get(entry.name, 0) for number, entry in enumerate(element.properties)}
            if all(
                (table[f"length {number}"] == count).all()
                for number, count in counts.items()
                if element.properties[number].length is not None
            ):
                self._at = start + element.count * row.itemsize
                return {
                    entry.name: _Column(table[str(number)].reshape(-1), np.full(element.count, counts[number]))
                    for number, entry in enumerate(element.properties)
                }
        self._at = start
        return self._read(element)

    def _read(self, element: PlyElement) -> _Table:
        return _read_rows(element, lambda kind, count: self._take(kind, count, element))

    def _take(self, kind: str, count: int, element: PlyElement) -> np.ndarray:
        size = count * int(kind[1])
        if self._at + size > len(self._data):
            raise DamagedMeshError(f"is cut off: its {element.count} rows of {element.name!r} are not all there")
        found = np.frombuffer(self._data, self._order + kind, count, self._at)
        self._at += size
        return found


def _read_rows(element: PlyElement, take: Callable[[str, int], np.ndarray]) -> _Table:
    """A table row by row: `take` gives the next numbers of a type."""
    values: dict[str, list[np.ndarray]] = {entry.name: [] for entry in element.properties}
    counts: dict[str, list[int]] = {entry.name: [] for entry in element.properties}
    for _ in range(element.count):
        for entry in element.properties:
            count = 1 if entry.length is None else int(take(entry.length, 1)[0])
            if count < 0:
                raise DamagedMeshError(f"has a list of {element.name!r} with {count} entries")
            values[entry.name].append(take(entry.kind, count))
            counts[entry.name].append(count)
    return {
        entry.name: _Column(
            np.concatenate([*values[entry.name], np.zeros(0, entry.kind)]), np.array(counts[entry.name], np.int64)
        )
        for entry in element.properties
    }


def _cast(values: Float[np.ndarray, " n"], kind: str) -> Shaped[np.ndarray, " n"]:
    """Numbers of text as the type that the header declares. Raises DamagedMeshError where they do not fit."""
    if kind[0] == "f":
        return values
    bounds = np.iinfo(kind)
    if not ((values >= bounds.min) & (values <= bounds.max)).all():
        raise DamagedMeshError(f"has whole numbers that are none, or are not from {bounds.min} to {bounds.max}")
    return values.astype(kind)
