"""Magic numbers: what a file is by its first bytes, whatever it is called, for errors that say so."""

from pathlib import Path

LONGEST = 512
"""Bytes that are looked at."""
_MAGIC: tuple[tuple[int, bytes, str], ...] = (
    (0, b"version https://git-lfs", "a pointer of Git LFS in place of the file itself (fetch it with `git lfs pull`)"),
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


def magic_of(head: bytes) -> str | None:
    """What data is that begins with `head`, as words for a sentence; None where its beginning tells nothing."""
    for offset, magic, name in _MAGIC:
        if head[offset : offset + len(magic)] == magic:
            return name
    text = head.lstrip(b"\xef\xbb\xbf \t\r\n").lower()
    named = next((name for magic, name in _TEXT if text.startswith(magic)), None)
    if named is None and head and all(32 <= byte < 127 or byte in b"\t\r\n" for byte in head):
        return "text"
    return named


def head_of(path: Path) -> bytes:
    """The first bytes of a file. Raises OSError where it cannot be read."""
    with path.open("rb") as file:
        return file.read(LONGEST)


def describe_mismatch(path: Path, expected: str, head: bytes | None = None) -> str:
    """A sentence: the file is not what its ending says, and what it is instead as far as its first bytes tell."""
    named = magic_of(head_of(path) if head is None else head)
    return f"{path} is no {expected}: it is {named or 'of another kind'}"
