"""Pictures that visitors bring to have their camera tracked: a video or a zip of pictures, kept until the app ends."""

import tempfile
from pathlib import Path

from nerfnav.errors import InvalidInputError
from nerfnav.importers.suffixes import VIDEOS
from nerfnav_app.places.uploads import MOST_BYTES, UploadError, safe_name

SUFFIXES = (*VIDEOS, ".zip")
"""Endings of what is taken."""
_PICTURES = (".png", ".jpg", ".jpeg", ".webp", ".bmp", ".txt", ".json", ".csv", ".yaml")
"""Endings of what is unpacked: pictures, and what tells their times and their camera."""


class TrackSources:
    """A folder with what was brought last."""

    def __init__(self) -> None:
        """Nothing is on disk before something is brought."""
        self._folder: tempfile.TemporaryDirectory[str] | None = None

    def keep(self, name: str, content: bytes) -> Path:
        """Where the pictures are that were brought in a file called `name`; what was brought before is kept, too.

        Raises UploadError for files of other kinds, empty or too large ones, and zips that are broken or no harmless
        ones.
        """
        safe = safe_name(name)
        ending = Path(safe).suffix.lower()
        if ending not in SUFFIXES:
            raise UploadError(f"{safe} is no video and no zip of pictures; these are taken: {', '.join(SUFFIXES)}")
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
