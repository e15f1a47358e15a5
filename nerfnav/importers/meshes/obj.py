"""Wavefront OBJ and its materials (MTL).

Read are `v` (also with colours), `vt`, `f` (polygons, negative indices), `usemtl` and `mtllib`, and of materials
`newmtl`, `Kd` and `map_Kd` with its options. Keywords count in any case, and lines go on after a backslash.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from nerfnav.formats.record import printable
from nerfnav.importers.core.kinds import decode_text
from nerfnav.importers.meshes.parts import GREY, DamagedMeshError, Part, srgb_bytes
from nerfnav.importers.meshes.polygons import triangulate
from nerfnav.importers.meshes.resolver import FolderResolver, PictureError
from nerfnav.world.surface import Image as Pixels

_OPTIONS = {
    "-blendu": 1, "-blendv": 1, "-cc": 1, "-clamp": 1, "-imfchan": 1, "-bm": 1, "-boost": 1, "-mm": 2, "-texres": 1,
    "-type": 1, "-colorspace": 1, "-o": 3, "-s": 3, "-t": 3,
}  # fmt: skip
"""Options of a texture, and the number of their values; those of -o, -s and -t may be fewer."""
_PLACING = ("-o", "-s", "-t")


class _Line(NamedTuple):
    """A line that says anything."""

    number: int
    """Number in the file, from 1; the last of lines that go on."""
    keyword: str
    """First word, in small letters."""
    words: str
    """The rest."""


@dataclass(frozen=True, eq=False)
class _Material:
    """Material of a library: its colour, else its picture."""

    color: Float[np.ndarray, " 3"] | None = None
    """sRGB, from 0 to 1."""
    picture: Pixels | None = None
    """Texture."""
    offset: Float[np.ndarray, " 2"] = field(default_factory=lambda: np.zeros(2))
    """Shift of its coordinates."""
    scale: Float[np.ndarray, " 2"] = field(default_factory=lambda: np.ones(2))
    """Factor of its coordinates."""
    is_grey: bool = False
    """True where it has a texture that cannot be had."""


def read_obj(path: Path, data: bytes, beside: FolderResolver) -> list[Part]:
    """The parts of an .obj, one for each material. Raises DamagedMeshError, with the line, for what is no OBJ."""
    content = _Content(_lines(decode_text(data)))
    points = _rows(content, "v", 3)
    if not len(points):
        raise DamagedMeshError("is not an .obj mesh: it has no line that gives a vertex (`v X Y Z`)")
    coordinates = _rows(content, "vt", 1)[:, :2]
    coordinates = np.pad(coordinates, ((0, 0), (0, 2 - coordinates.shape[1])))
    faces = _Faces(content, len(points), len(coordinates))
    if faces.missing:
        beside.note(f"{faces.missing} corners name texture coordinates that it does not have")
    materials: dict[str, _Material] = {}
    for line in content.rows["mtllib"]:
        for name in _library_names(line):
            materials = _library(name, beside) | materials
    used = dict.fromkeys(content.materials)
    absent = [name for name in used if name and name not in materials]
    if absent and materials:
        beside.note(f"its materials have no {', '.join(absent[:5])}, so what they cover is grey")
    triangles = triangulate(points[:, :3], faces.corners, faces.counts)
    number = np.repeat(np.arange(len(faces.counts)), faces.counts)[triangles[:, 0]]
    index = {name: position for position, name in enumerate(used)}
    material_of = np.array([index[name] for name in content.materials], np.int64)[number]
    return [
        _part(points, coordinates, faces, triangles[material_of == position], materials.get(name))
        for name, position in index.items()
    ]


def _lines(text: str) -> Iterator[_Line]:
    """The lines of a file that say anything: without comments, and with those that go on joined."""
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    number, held = 0, ""
    for line in text.split("\n"):
        number += 1
        if line.endswith("\\"):
            held += line[:-1] + " "
            continue
        line, held = held + line, ""
        words = (line.split("#", 1)[0] if "#" in line else line).split(None, 1)
        if words:
            yield _Line(number, words[0].lower(), words[1].rstrip() if len(words) > 1 else "")


class _Content:
    """Lines of a file, sorted by their keyword."""

    def __init__(self, lines: Iterator[_Line]) -> None:
        self.rows: dict[str, list[str]] = {"v": [], "vt": [], "mtllib": []}
        self.numbers: dict[str, list[int]] = {"v": [], "vt": [], "mtllib": []}
        self.corners: list[str] = []
        self.counts: list[int] = []
        self.face_numbers: list[int] = []
        self.points_before: list[int] = []
        self.coordinates_before: list[int] = []
        self.materials: list[str] = []
        material = ""
        for number, keyword, words in lines:
            if keyword in self.rows:
                self.rows[keyword].append(words)
                self.numbers[keyword].append(number)
            elif keyword == "usemtl":
                material = words
            elif keyword in ("f", "fo"):
                corners = words.split()
                self.corners += corners
                self.counts.append(len(corners))
                self.face_numbers.append(number)
                self.points_before.append(len(self.rows["v"]))
                self.coordinates_before.append(len(self.rows["vt"]))
                self.materials.append(material)


def _rows(content: _Content, keyword: str, least: int) -> Float[np.ndarray, "n k"]:
    """The numbers of all lines of a keyword; as many of each as all of them have."""
    rows = content.rows[keyword]
    widths = {len(row.split()) for row in rows} or {least}
    width = min(widths)
    try:
        if width < least:
            raise ValueError
        words = " ".join(rows).split() if len(widths) == 1 else [word for row in rows for word in row.split()[:width]]
        return np.array(list(map(float, words))).reshape(-1, width)
    except ValueError as error:
        for number, row in zip(content.numbers[keyword], rows, strict=True):
            if len(row.split()) < least or not all(map(_is_number, row.split())):
                raise DamagedMeshError(
                    f"is damaged: line {number}, `{keyword} {printable(row)}`, has not {least} numbers"
                ) from error
        raise


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


class _Faces:
    """Polygons of a file: for each corner a vertex, and texture coordinates or -1."""

    def __init__(self, content: _Content, points: int, coordinates: int) -> None:
        self.counts = np.array(content.counts, np.int64)
        line, points_before, coordinates_before = (
            np.repeat(np.array(values, np.int64), self.counts)
            for values in (content.face_numbers, content.points_before, content.coordinates_before)
        )
        words = content.corners
        position = {word: index for index, word in enumerate(dict.fromkeys(words))}  # most corners occur several times
        index = np.fromiter(map(position.__getitem__, words), np.int64, len(words))
        first_use = line[np.unique(index, return_index=True)[1]]
        split = [word.split("/", 2) for word in position]
        stored = _integers([parts[0] for parts in split], first_use)[index]
        self.corners = np.where(stored < 0, points_before + stored, stored - 1)
        wrong = np.flatnonzero((self.corners < 0) | (self.corners >= points))
        if len(wrong):
            raise DamagedMeshError(
                f"has a face with a corner that does not exist: line {line[wrong[0]]} names vertex "
                f"{stored[wrong[0]]}, and there are {points}"
            )
        stored = _integers([parts[1] if len(parts) > 1 and parts[1] else "0" for parts in split], first_use)[index]
        self.textured = np.where(stored < 0, coordinates_before + stored, stored - 1)
        outside = (self.textured < -1) | (self.textured >= coordinates)
        self.missing = int(outside.sum())
        self.textured[outside] = -1


def _integers(words: Sequence[str], line: Int[np.ndarray, " n"]) -> Int[np.ndarray, " n"]:
    try:
        return np.array([int(word) for word in words], np.int64)
    except (ValueError, OverflowError) as error:
        wrong = next(index for index, word in enumerate(words) if not re.fullmatch(r"[+-]?\d{1,18}", word))
        raise DamagedMeshError(
            f"is damaged: line {line[wrong]} has the corner {words[wrong][:40]!r}, no whole number"
        ) from error


def _part(
    points: Float[np.ndarray, "v k"],
    coordinates: Float[np.ndarray, "t 2"],
    faces: _Faces,
    triangles: Int[np.ndarray, "f 3"],
    material: _Material | None,
) -> Part:
    """The triangles, as positions among the corners of all faces, of one material."""
    corners, material = faces.corners[triangles], material or _Material()
    textured = faces.textured[triangles]
    uv = None
    if material.picture is not None and (textured >= 0).any():
        uv = np.where(textured[..., None] >= 0, coordinates[textured] * material.scale + material.offset, 0.0)
    tint = np.full((len(triangles), 3, 3), GREY, np.uint8)
    if uv is not None:
        tint[:] = 255
    elif material.color is not None and not material.is_grey:
        tint[:] = srgb_bytes(material.color[None], False)
    if points.shape[1] >= 6 and not material.is_grey and (uv is not None or material.color is None):
        colors = points[:, 3:6]  # from 0 to 1, or bytes
        tint = srgb_bytes(colors / 255 if colors.max() > 1 else colors, False)[corners]
    return Part(points[:, :3], corners, tint, uv, material.picture)


def _library_names(words: str) -> list[str]:
    """Names of the libraries in a line: several, or one with spaces in it."""
    names = re.findall(r".+?\.mtl(?=\s|[\"']|$)[\"']?", words, re.IGNORECASE) or words.split()
    return [name.strip("\"' ") for name in names]


def _library(name: str, beside: FolderResolver) -> dict[str, _Material]:
    """The materials of a library; none, and a note, where it is missing."""
    try:
        text = decode_text(beside.get(name))
    except DamagedMeshError as error:  # without it there are no colours, but all of the shape
        beside.note(f"it {error}, so that what these materials cover is grey")
        return {}
    found: dict[str, _Material] = {}
    for new, group in groupby(_named(_lines(text)), lambda entry: entry[0]):
        material = _Material()
        for _, (number, keyword, words) in group:
            if keyword == "kd" and (color := _color(words)) is not None:
                material = replace(material, color=color)
            elif keyword == "map_kd":
                material = _textured(material, words, f"{name}, line {number}", beside)
        found.setdefault(new, material)
    return found


def _named(lines: Iterator[_Line]) -> Iterator[tuple[str, _Line]]:
    """The lines that belong to a material, each with its name."""
    name = None
    for line in lines:
        name = line.words if line.keyword == "newmtl" else name
        if name is not None:
            yield name, line


def _color(words: str) -> Float[np.ndarray, " 3"] | None:
    """A colour; one number is grey, and a spectrum or CIE XYZ, which no program writes, none."""
    numbers = words.split()[:3]
    return np.array([float(word) for word in (numbers * 3)[:3]]) if numbers and all(map(_is_number, numbers)) else None


def _textured(material: _Material, words: str, where: str, beside: FolderResolver) -> _Material:
    """The material with the texture that a line names after its options."""
    placed = {"-o": np.zeros(2), "-s": np.ones(2)}
    ignored: list[str] = []
    while words.startswith("-") and (option := words.split(None, 1)[0].lower()) in _OPTIONS:
        _, *rest = words.split(None, 1)
        values: list[str] = []
        while rest and len(values) < _OPTIONS[option]:
            value, *after = rest[0].split(None, 1)
            if option in _PLACING and (not _is_number(value) or not after):
                break  # the name of the file
            values.append(value)
            rest = after
        words = rest[0] if rest else ""
        if option in placed:
            numbers = [float(value) for value in values[:2] if _is_number(value)]
            placed[option][: len(numbers)] = numbers
        elif option in ("-clamp", "-cc", "-imfchan", "-mm", "-t"):
            ignored.append(option)
    if ignored:
        beside.note(f"the options {', '.join(ignored)} of the texture in {where} are ignored")
    try:
        picture = beside.picture(words.strip("\"' "))
    except PictureError as error:
        beside.note(str(error))
        return replace(material, is_grey=True)
    return replace(material, picture=picture, offset=placed["-o"], scale=placed["-s"])
