"""Files of datasets: find them by names that other systems wrote, and leave out what only belongs to a file system.

Datasets travel between systems: names have backslashes (Windows), other capitals, or no ending (Blender); archives of
macOS hold a hidden ._NAME (AppleDouble) beside each file. This module is light on purpose: it imports no reader.
"""

import os
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

PICTURES = (".png", ".jpg", ".jpeg", ".webp", ".bmp", ".tif", ".tiff", ".heic")
"""Endings of pictures."""
PICTURE_FOLDERS = ("", "images", "input", "rgb", "images_2", "images_4", "images_8")
"""Folders of a dataset in which its pictures may lie, whatever its files say."""
_SYSTEM = ("__macosx", ".ds_store", "thumbs.db", "desktop.ini", "$recycle.bin", "@eadir")
"""Names of what macOS, Windows and network disks put into folders."""


def is_system_file(name: str) -> bool:
    """Return True for a path of which any part belongs to a file system and not to the dataset."""
    return any(part.startswith("._") or part.lower() in _SYSTEM for part in PurePosixPath(name).parts)


def list_folder(folder: Path, pattern: str = "*") -> list[Path]:
    """List the entries of a folder that match a pattern, by name, without those of the file system."""
    return sorted(entry for entry in folder.glob(pattern) if not is_system_file(entry.name))


def with_slashes(name: str) -> str:
    """A name with slashes in place of the backslashes that Windows writes."""
    return name.replace("\\", "/")


class NamedFiles:
    """Files below a folder, found by names that other systems wrote."""

    def __init__(self, folder: Path) -> None:
        """Names are relative to `folder`; its listings are read once, when a name is not found as it stands."""
        self._folder = folder
        self._listings: dict[Path, dict[str, Path]] = {}
        self._moved: dict[Path, str] = {}

    def find(self, name: str, endings: tuple[str, ...] = PICTURES) -> Path:
        """Path of a file: as named, with slashes for backslashes, with one of the `endings`, or in other capitals.

        Where there is none, the path as named.
        """
        spellings = [name] if "\\" not in name else [name, with_slashes(name)]
        named = (Path(f"{self._folder / spelling}{end}") for spelling in spellings for end in ("", *endings))
        found = next((path for path in named if os.path.isfile(path)), None)
        return found or self._in_other_capitals(with_slashes(name), endings) or self._folder / with_slashes(name)

    def find_picture(self, name: str) -> Path:
        """Path of a picture: as `find` gives it, else where the picture was moved to.

        Names may begin with folders of another computer, and pictures may lie in another folder of the dataset. A file
        stands for one name only: of two names that end alike, the second is not found.
        """
        path = self.find(name)
        if os.path.isfile(path):
            return path
        parts = [part for part in PurePosixPath(with_slashes(name)).parts if part not in ("/", "..")]
        for start in range(len(parts)):
            for folder in PICTURE_FOLDERS:
                moved = self.find("/".join((folder, *parts[start:])).lstrip("/"))
                if os.path.isfile(moved) and self._moved.setdefault(moved, name) == name:
                    return moved
        return path

    def _in_other_capitals(self, name: str, endings: tuple[str, ...]) -> Path | None:
        place = self._folder
        *folders, last = PurePosixPath(name).parts or ("",)
        for part in folders:
            found = place / part if os.path.isdir(place / part) else self._listed(place).get(part.lower())
            if found is None:
                return None
            place = found
        listed = self._listed(place)
        paths = (listed.get(f"{last}{end}".lower()) for end in ("", *endings))
        return next((path for path in paths if path is not None and os.path.isfile(path)), None)

    def _listed(self, folder: Path) -> dict[str, Path]:
        if folder not in self._listings:
            try:
                entries: Iterator[Path] = iter(list_folder(folder))
            except (OSError, ValueError):
                entries = iter(())
            self._listings[folder] = {entry.name.lower(): entry for entry in entries}
        return self._listings[folder]
