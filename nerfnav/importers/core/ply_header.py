"""PLY header: the format, the tables and the textures that a .ply file declares, for meshes and for splats."""

import re
from dataclasses import dataclass

PLY_FORMATS = {"ascii": "<", "binary_little_endian": "<", "binary_big_endian": ">"}
"""Formats by their names in the header, with numpy's sign of their byte order."""
LONGEST_HEADER = 1 << 16
"""Bytes in which a header ends."""
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
_MOST_ROWS = 1 << 40
_END = re.compile(rb"(?<=[\r\n])[ \t]*end_header[ \t]*(\r\n|\n|\r)", re.IGNORECASE)


class PlyHeaderError(ValueError):
    """A header that cannot be read: the message is the end of a sentence on the file."""


@dataclass(frozen=True)
class PlyProperty:
    """Column of a table."""

    name: str
    """As in the header, in small letters."""
    kind: str
    """Type of its numbers, as numpy names it, without byte order."""
    length: str | None = None
    """Type of the length of a list; None for a single number."""


@dataclass(frozen=True)
class PlyElement:
    """Table of a file."""

    name: str
    """Such as vertex or face, in small letters."""
    count: int
    """Rows that the header declares."""
    properties: list[PlyProperty]
    """Columns, in their order."""


@dataclass(frozen=True)
class PlyHeader:
    """Declarations of a file."""

    form: str
    """Key of PLY_FORMATS."""
    elements: list[PlyElement]
    """Tables, in their order."""
    textures: list[str]
    """Names of textures, which comments give."""
    size: int
    """Bytes of the header: the tables follow."""

    @property
    def order(self) -> str:
        """Byte order, as numpy's sign."""
        return PLY_FORMATS[self.form]


def parse_ply_header(data: bytes) -> PlyHeader:
    """Parse the header at the beginning of a file's bytes. Raises PlyHeaderError where there is none, or half of it."""
    end = _END.search(data[:LONGEST_HEADER])
    if data[:3].lower() != b"ply" or end is None:
        raise PlyHeaderError("is not a PLY file, or its header is cut off")
    form, elements, textures = "", [], []
    for line in data[: end.start()].decode("utf-8", "replace").splitlines()[1:]:
        words = line.split()
        try:
            match words[0].lower() if words else "":
                case "format":
                    form = words[1].lower()
                case "comment" | "obj_info" if len(words) > 2 and words[1].lower() == "texturefile":
                    textures.append(line.split(None, 2)[2].strip())
                case "element":
                    elements.append(PlyElement(words[1].lower(), _count(words[2]), []))
                case "property" if words[1].lower() == "list":
                    length, kind = (_TYPES[word.lower()] for word in words[2:4])
                    elements[-1].properties.append(PlyProperty(words[4].lower(), kind, length))
                case "property":
                    elements[-1].properties.append(PlyProperty(words[2].lower(), _TYPES[words[1].lower()]))
        except (IndexError, KeyError, ValueError) as error:
            raise PlyHeaderError(f"has a line in its header that makes no sense: {line[:60]!r}") from error
    if form not in PLY_FORMATS:
        raise PlyHeaderError(f"is of the format {form[:60] or 'none'!r}; PLY has {', '.join(PLY_FORMATS)}")
    return PlyHeader(form, elements, textures, end.end())


def _count(word: str) -> int:
    if not 0 <= int(word) < _MOST_ROWS:
        raise ValueError("a count out of range")
    return int(word)
