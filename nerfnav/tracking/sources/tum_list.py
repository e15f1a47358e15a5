"""TUM list: a folder with a list of pictures and their times, as TUM's RGB-D sequences have it.

# timestamp filename
1305031102.175304 rgb/1305031102.175304.png
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry import Camera
from nerfnav.tracking.frame import Frame, ImuMeasurements
from nerfnav.tracking.sources.pictures import TimedFile, pictures_of

_NAME = "rgb.txt"


@dataclass(frozen=True)
class ListSource:
    """Pictures and their times (a FrameSource)."""

    listed: tuple[TimedFile, ...]
    """Time [s] and file of each, as they are listed."""
    camera: Camera | None = None
    """Unknown."""
    inertial: ImuMeasurements | None = None
    """There is none."""
    aspect: float | None = None
    """Width over height of the camera, where that is known after all."""

    @classmethod
    def of(cls, path: Path, aspect: float | None = None) -> "ListSource":
        """The pictures of a folder's rgb.txt, or of a list itself. Raises InvalidInputError for an unreadable line."""
        path = path / _NAME if path.is_dir() else path
        try:
            lines = path.read_text(encoding="utf-8").splitlines()
        except (OSError, UnicodeDecodeError) as error:
            raise InvalidInputError(f"the list {path} cannot be read: {error}") from error
        listed = [
            _entry(line, f"line {number} of {path}", path.parent)
            for number, line in enumerate(lines, 1)
            if line.strip() and not line.startswith("#")
        ]
        if not listed:
            raise InvalidInputError(f"the list {path} names no pictures")
        return cls(tuple(listed), aspect=aspect)

    @property
    def count(self) -> int:
        """Number of pictures of the list."""
        return len(self.listed)

    def frames(self) -> Iterator[Frame]:
        """Yield each frame; see FrameSource."""
        return pictures_of(self.listed, self.aspect)


def is_list(path: Path) -> bool:
    """Return True for such a list, or a folder that holds one."""
    return path.name == _NAME or (path / _NAME).is_file()


def _entry(line: str, where: str, folder: Path) -> TimedFile:
    seconds, _, name = line.strip().partition(" ")
    try:
        return TimedFile(float(seconds), folder / name.strip())
    except ValueError as error:
        raise InvalidInputError(f"{where} is no time [s] and a file's name: {line.strip()[:80]!r}") from error
