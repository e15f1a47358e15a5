"""Source kinds: endings and magic numbers of files, kinds of sources, and the names of their fields.

Light on purpose: naming an ending or a kind imports none of the readers.
"""

from collections.abc import Iterable
from enum import Enum
from pathlib import Path, PurePath

from nerfnav.core.files import LFS_POINTER, NOT_FETCHED

FIELD = ".npz"
"""A field that nerfnav wrote."""
MESHES = (".glb", ".gltf", ".obj", ".ply", ".stl", ".off", ".dae")
SPLATS = (".ply", ".splat", ".spz", ".sog", ".ksplat")
"""Gaussian splats; a .ply may be a mesh instead."""
OWN_SPLATS = ".splats.npz"
"""nerfnav's own files of splats, stored beside their field."""
CHECKPOINTS = (".ckpt", ".tar", ".pth", ".pt")
"""Trained NeRFs."""
ARCHIVES = (".zip", ".r3d")
"""Archives that hold a capture or a mesh."""
VIDEOS = (".mp4", ".mov", ".m4v", ".avi", ".mkv", ".webm")
UPLOADS = tuple(dict.fromkeys((FIELD, *MESHES, *SPLATS, *ARCHIVES, *VIDEOS, *CHECKPOINTS)))
"""All that can be opened as one file."""


class SourceKind(Enum):
    """Kind of a source, as the words of a sentence."""

    SCENE = "a bundled scene"
    FIELD = "a field"
    SPLATS = "a set of Gaussian splats"
    MESH = "a mesh"
    CAPTURE = "a capture"
    VIDEO = "a video"
    NERF = "a trained NeRF"
    PICTURE = "a picture"
    FLIGHT = "the folder of a flight"
    PLAN = "the folder of a plan"
    TRUTH = "the ground truth of a field"
    MISSING = "not there"
    UNKNOWN = "of no kind that nerfnav knows"

    @property
    def command(self) -> str | None:
        """The subcommand that makes a field of it; None where none does."""
        if self in (SourceKind.MESH, SourceKind.CAPTURE, SourceKind.VIDEO):
            return "train"
        return "import" if self in (SourceKind.SPLATS, SourceKind.NERF) else None


_DESCRIPTIONS = ("meta.json", "transforms.json", "config.yml")


def folder_of_source(source: Path) -> Path | None:
    """The folder that a source is, or that a file describes which is called as in all such folders; else None."""
    if source.is_dir():
        return source
    return source.parent if source.name.lower() in _DESCRIPTIONS else None


_OF_CAPTURES = ("transforms", "cameras.", "images.", "keyframes", "frame_0", "rgbd", "metadata")
"""Beginnings of file and folder names that only captures have; theirs may hold a mesh or splats, too."""
_OF_SPLATS = "cameras.json"
"""File that the training of splats leaves beside them."""


def names_capture(names: Iterable[PurePath]) -> bool:
    """True for names of files, in an archive, of which one is that of a capture."""
    return any(part.startswith(_OF_CAPTURES) and part != _OF_SPLATS for name in names for part in name.parts)


def field_name(what: str | Path) -> str:
    """File name of the field of a source."""
    path = Path(what)
    folder = folder_of_source(path)
    stem = path.name.split(".")[0] if folder is None else folder.resolve().name
    return f"{stem or 'place'}{FIELD}"


HEAD_BYTES = 512
"""Bytes that are examined."""
_MAGIC: tuple[tuple[int, bytes, str], ...] = (
    (0, LFS_POINTER, NOT_FETCHED),
    (0, b"ply", "a PLY file"),
    (0, b"glTF", "a binary glTF mesh (.glb)"),
    (0, b"NGSP", "Gaussian splats as SPZ (.spz)"),
    (0, b"\x1f\x8b", "gzip data, as .spz files of splats are"),
    (0, b"PK\x03\x04", "a zip archive"),
    (0, b"PK\x05\x06", "an empty zip archive"),
    (0, b"Rar!", "a RAR archive (pack it as .zip)"),
    (0, b"7z\xbc\xaf\x27\x1c", "a 7z archive (pack it as .zip)"),
    (0, b"\x89PNG", "a PNG picture"),
    (0, b"\xff\xd8\xff", "a JPEG picture"),
    (8, b"WEBP", "a WebP picture"),
    (0, b"\xabKTX 20", "a KTX2 texture"),
    (4, b"ftyp", "a video or picture (ISO media)"),
    (0, b"\x1aE\xdf\xa3", "a video (Matroska)"),
    (8, b"AVI ", "a video (AVI)"),
    (0, b"\x93NUMPY", "a NumPy array"),
    (0, b"%PDF", "a PDF document"),
    (0, b"Kaydara FBX", "an FBX model (export it as .glb)"),
    (0, b"BLENDER", "a Blender file (export it as .glb)"),
    (0, b"PXR-USDC", "a USD model (export it as .glb)"),
    (0, b"\x80\x02", "a Python pickle"),
)
_TEXT: tuple[tuple[bytes, str], ...] = (
    (b"<!doctype html", "a web page (the address led to a page, not to the file)"),
    (b"<html", "a web page (the address led to a page, not to the file)"),
    (b"<?xml", "XML"),
    (b"{", "JSON"),
    (b"solid", "a text STL mesh"),
)


_MARKS = (
    (b"\xef\xbb\xbf", "utf-8-sig"),
    (b"\xff\xfe\0\0", "utf-32"),
    (b"\0\0\xfe\xff", "utf-32"),
    (b"\xff\xfe", "utf-16"),
    (b"\xfe\xff", "utf-16"),
)
"""Byte order marks; that of UTF-32 begins like that of UTF-16."""


def identify_data(head: bytes) -> str | None:
    """Name the kind of data that begins with `head`, as words for a sentence; None where it is not recognized."""
    for offset, magic, name in _MAGIC:
        if head[offset : offset + len(magic)] == magic:
            return name
    text = head.lstrip(b"\xef\xbb\xbf \t\r\n").lower()
    named = next((name for magic, name in _TEXT if text.startswith(magic)), None)
    if named is None and head and all(32 <= byte < 127 or byte in b"\t\r\n" for byte in head):
        return "text"
    return named


def decode_text(data: bytes) -> str:
    """The text of a file by its byte order mark, else as UTF-8, else as Latin-1, in which any bytes are text."""
    for mark, encoding in _MARKS:
        if data.startswith(mark):
            return data.decode(encoding, "replace")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def read_head(path: Path) -> bytes:
    """The first bytes of a file. Raises OSError where it cannot be read."""
    with path.open("rb") as file:
        return file.read(HEAD_BYTES)


def describe_mismatch(path: Path, expected: str, head: bytes | None = None) -> str:
    """Sentence: the file is not of its ending's kind, and its kind as far as its first bytes identify it."""
    named = identify_data(read_head(path) if head is None else head)
    return f"{path} is no {expected}: it is {named or 'of another kind'}"
