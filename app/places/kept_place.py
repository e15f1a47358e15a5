"""A place of the library: what is known of it, beside it on disk."""

import json
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

from nerfnav.errors import InvalidInputError
from nerfnav.files import replacing

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
        """What is opened."""
        return str(self.folder / self.source)

    @property
    def field_file(self) -> Path:
        """Where its field is."""
        return self.folder / self.field

    @property
    def picture_file(self) -> Path:
        """Where its picture is; nothing may be there."""
        return self.folder / PICTURE


def read_place(folder: Path) -> KeptPlace | None:
    """What is known of a place; None where nothing is, or its field is gone."""
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
    """Raises InvalidInputError where the disk does not take it."""
    about = {key: value for key, value in asdict(place).items() if key in _KNOWN}
    try:
        with replacing(place.folder / ABOUT) as stream:
            stream.write(json.dumps(about).encode())
    except OSError as error:
        raise InvalidInputError(f"what is known of {place.name} cannot be written: {error.strerror}") from error


def keep_picture(place: KeptPlace, picture: bytes) -> None:
    """Keep what it looks like; without a picture, it is listed all the same."""
    with suppress(OSError), replacing(place.picture_file) as stream:
        stream.write(picture)
