"""Image folder: pictures whose names are the times at which they were taken.

A name with a point is a time in s (TUM: 1305031102.175304.png), one of 16 digits and more in ns (ROS, EuRoC:
1403636579763555584.png). Shorter whole numbers count pictures and tell no time.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry import Camera
from nerfnav.tracking.frame import Frame, ImuMeasurements
from nerfnav.tracking.sources.pictures import SUFFIXES, TimedFile, pictures_of

_NANOSECONDS = 16
"""Digits from which a whole number is a time in ns."""


@dataclass(frozen=True)
class FolderSource:
    """Pictures and their times (a FrameSource)."""

    listed: tuple[TimedFile, ...]
    """Time [s] and file of each, in order."""
    camera: Camera | None = None
    """Unknown."""
    inertial: ImuMeasurements | None = None
    """There is none."""
    aspect: float | None = None
    """Width over height of the camera, where that is known after all."""

    @classmethod
    def of(cls, folder: Path, fps: float | None = None, aspect: float | None = None) -> "FolderSource":
        """All pictures of a folder; with `fps` [1/s] in the order of their names, whatever those say.

        Raises InvalidInputError where a name tells no time.
        """
        files = _pictures_in(folder)
        if fps is not None:
            counted = enumerate(sorted(files, key=_counted))
            return cls(tuple(TimedFile(index / fps, path) for index, path in counted), aspect=aspect)
        times = [TimedFile(_time_of(path), path) for path in files]
        return cls(tuple(sorted(times)), aspect=aspect)

    @property
    def count(self) -> int:
        """Number of pictures of the folder."""
        return len(self.listed)

    def frames(self) -> Iterator[Frame]:
        """Yield each frame; see FrameSource."""
        return pictures_of(self.listed, self.aspect)


def is_folder_of_pictures(path: Path) -> bool:
    """Return True for a folder that holds pictures."""
    return path.is_dir() and bool(_pictures_in(path))


def _pictures_in(folder: Path) -> list[Path]:
    return [path for path in folder.iterdir() if path.suffix.lower() in SUFFIXES and path.is_file()]


def _counted(path: Path) -> tuple[int, str]:
    """Order of names: "frame9" before "frame10"."""
    return len(path.stem), path.stem


def _time_of(path: Path) -> float:
    name = path.stem
    if name.isdecimal() and len(name) >= _NANOSECONDS:
        return int(name) / 1e9
    whole, point, part = name.partition(".")
    if point and whole.isdecimal() and part.isdecimal():
        return float(name)
    raise InvalidInputError(
        f"the picture {path.name} tells no time: name pictures by theirs (in s with a point, or in ns), list them in "
        "rgb.txt (TUM), or say how many there are in a second (fps)"
    )
