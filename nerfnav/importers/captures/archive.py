"""Capture archives: unpack a capture from an untrusted .zip file, with limits on count and size."""

import lzma
import struct
import zipfile
import zlib
from pathlib import Path, PurePosixPath

from nerfnav.formats import PICTURES, is_system_file, with_slashes
from nerfnav.importers.captures.formats import is_capture
from nerfnav.importers.captures.views import CaptureError

MOST_FILES = 20_000
"""Files that are unpacked."""
MOST_BYTES = 4 << 30
"""Bytes that are unpacked."""
MOST_SWELLING = 200
"""Largest ratio of content to archive size, above the allowance `_FREE_BYTES`."""
_FREE_BYTES = 64 << 20
"""Content that every archive may hold, however small it is."""
_NAMED = ("metadata",)
"""Extensionless files of captures: Record3D's."""
_WANTED = (".json", ".txt", ".bin", ".npy", *PICTURES)
"""Endings of files that captures consist of; others stay in the archive."""
BROKEN = (
    zipfile.BadZipFile, zlib.error, lzma.LZMAError, struct.error, EOFError, UnicodeDecodeError, ValueError,
    NotImplementedError, RuntimeError,
)  # fmt: skip
"""Exceptions of zipfile for broken data; the last two are for unknown methods and passwords."""
_REASON = "it is cut off, encrypted or another kind of file"
_DEPTH = 3
"""Folders under which the capture may lie in the archive."""


def unpack_capture(archive: Path, into: Path) -> Path:
    """Unpack an archive into the folder `into`, and return the folder of the capture in it.

    It is the uppermost folder that is one. Raises CaptureError as `extract` does, and where the archive holds none.
    """
    extract(archive, into)
    level = [into]
    for _ in range(_DEPTH):
        for candidate in level:
            if is_capture(candidate):
                return candidate
        level = sorted(child for parent in level for child in parent.iterdir() if child.is_dir())
    raise CaptureError(
        f"{archive} holds no capture: there is no transforms.json, no transforms_train.json, no COLMAP model and no "
        "export of Polycam, Record3D or 3D Scanner App in it"
    )


def list_names(archive: Path) -> list[str]:
    """Names of the files in an archive. Raises CaptureError where it is broken."""
    try:
        with zipfile.ZipFile(archive) as content:
            return [entry.filename for entry in files_in(content)]
    except BROKEN as error:
        raise CaptureError(f"{archive} is no readable .zip: {_REASON}") from error


def extract(archive: Path, into: Path, endings: tuple[str, ...] = _WANTED) -> None:
    """Unpack the files of an archive that have one of the endings into the folder `into`.

    Raises CaptureError where the archive is broken, leads out of its folder, or swells beyond measure.
    """
    try:
        with zipfile.ZipFile(archive) as content:
            for entry in _wanted(content, archive, endings):
                content.extract(entry, into)  # reads no more than the size that was judged
    except BROKEN as error:
        raise CaptureError(f"{archive} is no readable .zip: {_REASON}") from error
    except OSError as error:
        raise CaptureError(f"{archive} cannot be unpacked: {error.strerror}") from error


def files_in(content: zipfile.ZipFile) -> list[zipfile.ZipInfo]:
    """Files of an archive, with slashes in their names, and without those that belong to a file system."""
    entries = content.infolist()
    for entry in entries:
        entry.filename = with_slashes(entry.filename)
    return [entry for entry in entries if not entry.is_dir() and not is_system_file(entry.filename)]


def _wanted(content: zipfile.ZipFile, archive: Path, endings: tuple[str, ...]) -> list[zipfile.ZipInfo]:
    entries = files_in(content)
    for entry in entries:
        path = PurePosixPath(entry.filename)
        if path.is_absolute() or ".." in path.parts or ":" in "".join(path.parts[:1]):
            raise CaptureError(f"{archive} names a file outside of its own folder: {entry.filename}")
    wanted = [
        entry
        for entry in entries
        if PurePosixPath(entry.filename).suffix.lower() in endings or PurePosixPath(entry.filename).name in _NAMED
    ]
    total = sum(entry.file_size for entry in wanted)
    if len(wanted) > MOST_FILES or total > MOST_BYTES:
        raise CaptureError(
            f"{archive} holds {len(wanted)} files of {total >> 20} MB together; at most {MOST_FILES} files of "
            f"{MOST_BYTES >> 20} MB are unpacked"
        )
    if total > _FREE_BYTES + MOST_SWELLING * archive.stat().st_size:
        raise CaptureError(f"{archive} would swell to {total >> 20} MB, which no photographs do: it is not unpacked")
    return wanted
