"""Files that visitors bring: what is taken, how it is kept, and under which names, none of which leads out of a folder.
"""

import hashlib
import re
from pathlib import Path

from nerfnav.core.errors import NerfnavError
from nerfnav.core.files import replacing
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
        with replacing(path) as stream:
            stream.write(content)
    except OSError as error:
        raise UploadError(f"{path.name} cannot be kept: {error.strerror}") from error
