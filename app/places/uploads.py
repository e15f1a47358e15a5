"""Uploads: which files are accepted, and under which names they are kept, none of which leads out of a folder.

Videos and zips of pictures, to have their camera tracked, are kept until the app ends.
"""

import hashlib
import re
import tempfile
from pathlib import Path

from nerfnav.core.errors import InvalidInputError, NerfnavError
from nerfnav.core.files import replace_file
from nerfnav.formats import PICTURES
from nerfnav.importers.core.kinds import VIDEOS
from nerfnav_app.places.sources import SUFFIXES

MOST_BYTES = 512 << 20
"""Largest file that is taken [bytes]."""
_LONGEST_NAME = 80
_DIGITS = 16


class UploadError(NerfnavError):
    """A file that is not taken."""


def check_upload(name: str, content: bytes) -> str:
    """The name under which a file is kept, as near to `name` as is safe.

    Raises UploadError for files that are empty, too large, or of no kind that can be opened.
    """
    safe = safe_name(name)
    if Path(safe).suffix.lower() not in SUFFIXES:
        raise UploadError(f"{safe} is of no kind that can be opened; these can: {', '.join(SUFFIXES)}")
    if not content:
        raise UploadError(f"{safe} is empty")
    if len(content) > MOST_BYTES:
        raise UploadError(f"{safe} is larger than {MOST_BYTES >> 20} MB: use the command line for it")
    return safe


def safe_name(name: str) -> str:
    """The last part of a path, of harmless characters only, never hidden, never empty."""
    last = re.split(r"[\\/]", name)[-1]
    harmless = re.sub(r"[^A-Za-z0-9._-]", "_", last).lstrip(".")[-_LONGEST_NAME:]
    return harmless or "upload"


class NameRefusedError(NerfnavError):
    """A name that no stored flight or place can have."""


def check_name(name: str, longest: int) -> str:
    """The name, if it is harmless: no folders, nothing hidden, no longer than that. Raises NameRefusedError."""
    harmless = isinstance(name, str) and re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9 ._-]*", name)
    if not harmless or len(name) > longest or name.endswith((".", " ")):
        raise NameRefusedError(
            f"a name has up to {longest} letters, digits, spaces, '.', '_' and '-', begins with a letter or a digit, "
            "and does not end with a dot or a space"
        )
    return name


def folder_of(*content: bytes) -> str:
    """The name of the folder in which a library keeps some content: what is the same is there once."""
    digest = hashlib.sha256()
    for part in content:
        digest.update(part)
    return digest.hexdigest()[:_DIGITS]


def write_upload(path: Path, content: bytes) -> None:
    """Write a whole file or none, its folder included. Raises UploadError where the disk does not take it."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with replace_file(path) as stream:
            stream.write(content)
    except OSError as error:
        raise UploadError(f"{path.name} cannot be kept: {error.strerror}") from error


TRACK_SUFFIXES = (*VIDEOS, ".zip")
"""Endings of what is taken."""
_PICTURES = (*PICTURES, ".txt", ".json", ".csv", ".yaml")
"""Endings of what is unpacked: pictures, and what tells their times and their camera."""


class TrackSources:
    """A folder with what was brought last."""

    def __init__(self) -> None:
        """Nothing is on disk before something is brought."""
        self._folder: tempfile.TemporaryDirectory[str] | None = None

    def keep(self, name: str, content: bytes) -> Path:
        """Keep the pictures of an upload called `name`, and return their path; earlier uploads are kept, too.

        Raises UploadError for files of other kinds, empty or too large ones, and zips that are broken or no harmless
        ones.
        """
        safe = safe_name(name)
        ending = Path(safe).suffix.lower()
        if ending not in TRACK_SUFFIXES:
            taken = ", ".join(TRACK_SUFFIXES)
            raise UploadError(f"{safe} is no video and no zip of pictures; these are taken: {taken}")
        if not 0 < len(content) <= MOST_BYTES:
            raise UploadError(f"{safe} is empty, or larger than {MOST_BYTES >> 20} MB: use nerfnav track for it")
        if self._folder is None:
            self._folder = tempfile.TemporaryDirectory(prefix="nerfnav-", ignore_cleanup_errors=True)
        path = Path(tempfile.mkdtemp(dir=self._folder.name)) / safe
        try:
            path.write_bytes(content)
            return path if ending != ".zip" else _unpacked(path)
        except OSError as error:
            raise UploadError(f"{safe} cannot be kept: {error.strerror}") from error


def _unpacked(archive: Path) -> Path:
    """The folder of the pictures in a zip, which is deleted."""
    from nerfnav.importers.captures.archive import extract  # slow to import: not before the page is shown

    folder = archive.parent / "pictures"
    try:
        extract(archive, folder, _PICTURES)
    except InvalidInputError as error:
        raise UploadError(str(error).replace(f"{archive.parent}/", "")) from error
    archive.unlink()
    while folder.is_dir() and len(inside := list(folder.iterdir())) == 1 and inside[0].is_dir():
        folder = inside[0]
    if not folder.is_dir():
        raise UploadError(f"{archive.name} holds no pictures")
    return folder
