"""Library of places: what visitors have brought, on disk, with the fields that were made of it.

One folder for each, named by a digest of what was brought, so that the same upload finds its field again; a field that
was corrected by hand is a place of its own, in a folder with a name by chance:

    SHA256 (16 digits)/
        NAME             what was brought, and beside it its field, its ground truth, its splats
        place.json       what is known of it, once it was opened: without it, it is in no list
        picture.jpg      what it looks like
    robots/              see app/places/robot_library.py
"""

import json
import os
import re
import secrets
import shutil
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

from platformdirs import user_data_path

from nerfnav.core.errors import InvalidInputError, UnknownNameError
from nerfnav.core.files import replace_file
from nerfnav_app.places.robot_library import RobotLibrary
from nerfnav_app.places.uploads import NameRefusedError, check_name, check_upload, folder_of, write_upload

ABOUT, PICTURE = "place.json", "picture.jpg"
"""Files in its folder: what is known of it, and what it looks like."""
_KNOWN = ("name", "source", "date", "field")


@dataclass(frozen=True)
class KeptPlace:
    """A place of the library."""

    key: str
    """Name of its folder."""
    name: str
    """What users call it."""
    source: str
    """Name of the file that was brought."""
    date: str
    """When it was opened first, UTC."""
    field: str
    """Name of the file of its field, in its folder."""
    folder: Path
    """Where it is."""
    size_bytes: int = 0
    """Of everything in its folder."""

    @classmethod
    def of_now(cls, name: str, source: Path, field: Path) -> "KeptPlace":
        """A place that was opened just now, of a file in its folder, with its field beside it."""
        now = datetime.now(UTC).isoformat(timespec="seconds")
        return cls(source.parent.name, name, source.name, now, field.name, source.parent)

    @property
    def what(self) -> str:
        """Path of the source, which is opened."""
        return str(self.folder / self.source)

    @property
    def field_file(self) -> Path:
        """Path of its field."""
        return self.folder / self.field

    @property
    def picture_file(self) -> Path:
        """Path of its picture, which may be missing."""
        return self.folder / PICTURE


def read_place(folder: Path) -> KeptPlace | None:
    """Read the record of a place; None where there is none, or its field is gone."""
    try:
        about = json.loads((folder / ABOUT).read_text())
        name, source, date, field = (str(about[key]) for key in _KNOWN)
        place = KeptPlace(folder.name, name, source, date, field, folder)
        size = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
    except (OSError, ValueError, KeyError, TypeError):
        return None
    inside = all(Path(name).name == name for name in (place.source, place.field))
    return replace(place, size_bytes=size) if inside and place.field_file.is_file() else None


def write_place(place: KeptPlace) -> None:
    """Write the record of a place. Raises InvalidInputError where the disk does not take it."""
    about = {key: value for key, value in asdict(place).items() if key in _KNOWN}
    try:
        with replace_file(place.folder / ABOUT) as stream:
            stream.write(json.dumps(about).encode())
    except OSError as error:
        raise InvalidInputError(f"what is known of {place.name} cannot be written: {error.strerror}") from error


def keep_picture(place: KeptPlace, picture: bytes) -> None:
    """Keep what it looks like; without a picture, it is listed all the same."""
    with suppress(OSError), replace_file(place.picture_file) as stream:
        stream.write(picture)


VARIABLE = "NERFNAV_PLACES"
"""Environment variable with the folder of the library."""
_LONGEST_NAME = 60


class PlaceLibrary:
    """Takes, lists, renames and deletes places."""

    def __init__(self, folder: Path | None = None) -> None:
        """Without a folder, the one that NERFNAV_PLACES names, else places/ in the user's data folder."""
        own = user_data_path("nerfnav", appauthor=False) / "places"
        self.folder = folder or Path(os.environ.get(VARIABLE) or own)
        self.robots = RobotLibrary(self.folder / "robots")
        self._brought: list[Path] = []

    def keep(self, name: str, content: bytes) -> Path:
        """Write what was brought to a file called `name` as far as that is safe; what was brought before is there.

        Raises UploadError for files that are empty, too large, of no kind that can be opened, or do not fit the disk.
        """
        safe = check_upload(name, content)
        path = self.folder / folder_of(content) / safe
        known = read_place(path.parent)
        if known is not None and Path(known.what).is_file():
            return Path(known.what)
        write_upload(path, content)
        self._brought.append(path.parent)
        return path

    def new_folder(self) -> Path:
        """Choose a folder for a place that is made of another one; it is listed once it was opened."""
        return self.folder / secrets.token_hex(8)

    def entries(self) -> tuple[KeptPlace, ...]:
        """The places that were opened, by name."""
        return tuple(sorted(self._all(), key=lambda place: place.name.lower()))

    def place_of(self, path: str | Path) -> KeptPlace | None:
        """The place that a file belongs to."""
        return read_place(Path(path).parent) if self.holds(path) else None

    def holds(self, path: str | Path) -> bool:
        """Check whether a file is in the library."""
        return Path(path).parent.parent == self.folder

    def opened(self, source: Path, field: Path, picture: bytes) -> KeptPlace | None:
        """Note that the place of a `source` in the library was opened, with its field; None for files elsewhere."""
        if not self.holds(source):
            return None
        known = read_place(source.parent)
        if known is None:
            name = self._free_name(re.sub(r"[^A-Za-z0-9 ._-]", "_", source.stem).strip(" ._-") or "place")
            known = KeptPlace.of_now(name, source, field)
        keep_picture(known, picture)
        write_place(replace(known, field=field.name))
        return known

    def rename(self, key: str, to: str) -> None:
        """Give a place another name. Raises NerfnavError where it is bad or taken."""
        place = self._place(key)
        check_name(to, _LONGEST_NAME)
        if any(other.name == to and other.key != key for other in self._all()):
            raise NameRefusedError(f"there is already a place called {to!r}: choose another name")
        write_place(replace(place, name=to))

    def delete(self, key: str) -> None:
        """Delete a place for good. Raises NerfnavError where there is none, or it cannot be deleted."""
        try:
            shutil.rmtree(self._place(key).folder)
        except OSError as error:
            raise InvalidInputError(f"the place cannot be deleted: {error.strerror}") from error

    def close(self) -> None:
        """Delete uploads that never opened."""
        for folder in self._brought:
            if not (folder / ABOUT).is_file():
                shutil.rmtree(folder, ignore_errors=True)

    def _all(self) -> Iterator[KeptPlace]:
        with suppress(OSError):
            for folder in self.folder.iterdir():
                place = read_place(folder)
                if place is not None:
                    yield place

    def _place(self, key: str) -> KeptPlace:
        found = {place.key: place for place in self._all()}
        if key not in found:
            raise UnknownNameError("place", key, sorted(place.name for place in found.values()))
        return found[key]

    def _free_name(self, name: str) -> str:
        taken = {place.name for place in self._all()}
        names = (name[:50] if count == 1 else f"{name[:50]} {count}" for count in range(1, 10_000))
        return next(free for free in names if free not in taken)
