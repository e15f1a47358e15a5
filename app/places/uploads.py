"""Files that visitors bring: kept in a folder of this run alone, under names that cannot lead out of it."""

import re
import tempfile
from pathlib import Path

from app.places.sources import SUFFIXES
from nerfnav.errors import NerfnavError

MOST_BYTES = 512 << 20
"""Largest file that is taken [bytes]."""
_LONGEST_NAME = 80


class UploadError(NerfnavError):
    """A file that is not taken."""


class Uploads:
    """A folder for uploads that is gone when the app ends."""

    def __init__(self) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="nerfnav-", ignore_cleanup_errors=True)
        self._count = 0

    def keep(self, name: str, content: bytes) -> Path:
        """Write `content` to a file of its own, called `name` as far as that is safe; each into its own folder.

        Raises UploadError for files that are empty, too large, of no kind that can be opened, or do not fit the disk.
        """
        safe = safe_name(name)
        if Path(safe).suffix.lower() not in SUFFIXES:
            raise UploadError(f"{safe} is of no kind that can be opened; these can: {', '.join(SUFFIXES)}")
        if not content:
            raise UploadError(f"{safe} is empty")
        if len(content) > MOST_BYTES:
            raise UploadError(f"{safe} is larger than {MOST_BYTES >> 20} MB: use the command line for it")
        self._count += 1
        path = Path(self._folder.name) / str(self._count) / safe
        try:
            path.parent.mkdir()
            path.write_bytes(content)
        except OSError as error:
            raise UploadError(f"{safe} cannot be kept: {error.strerror}") from error
        return path

    def close(self) -> None:
        """Delete everything."""
        self._folder.cleanup()


def safe_name(name: str) -> str:
    """The last part of a path, of harmless characters only, never hidden, never empty."""
    last = re.split(r"[\\/]", name)[-1]
    harmless = re.sub(r"[^A-Za-z0-9._-]", "_", last).lstrip(".")[-_LONGEST_NAME:]
    return harmless or "upload"
