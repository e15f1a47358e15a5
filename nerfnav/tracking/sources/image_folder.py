"""Image folder: pictures whose names are the times at which they were taken.

A name with a point is a time in s (TUM: 1305031102.175304.png), one of 16 digits and more in ns (ROS, EuRoC:
1403636579763555584.png). Shorter whole numbers count pictures and tell no time.
"""

from pathlib import Path

from nerfnav.core.errors import InvalidInputError
from nerfnav.tracking.sources.pictures import SUFFIXES, FileSource, TimedFile

_NANOSECONDS = 16
"""Digits from which a whole number is a time in ns."""


def open_folder(folder: Path, fps: float | None = None, aspect: float | None = None) -> FileSource:
    """All pictures of a folder; with `fps` [1/s] in the order of their names, whatever those say.

    `aspect` is that of the camera, where it is known after all. Raises InvalidInputError where a name tells no time.
    """
    files = _pictures_in(folder)
    if fps is None:
        return FileSource(tuple(sorted(TimedFile(_time_of(path), path) for path in files)), aspect)
    in_order = sorted(files, key=lambda path: (len(path.stem), path.stem))  # "frame9" before "frame10"
    return FileSource(tuple(TimedFile(index / fps, path) for index, path in enumerate(in_order)), aspect)


def is_folder_of_pictures(path: Path) -> bool:
    """Return True for a folder that holds pictures."""
    return path.is_dir() and bool(_pictures_in(path))


def _pictures_in(folder: Path) -> list[Path]:
    return [path for path in folder.iterdir() if path.suffix.lower() in SUFFIXES and path.is_file()]


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
