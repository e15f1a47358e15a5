"""Image folder: pictures whose names are the times at which they were taken.

Names that count pictures tell no time; see `nerfnav.formats.time_in_name`.
"""

from pathlib import Path

from nerfnav.core.errors import InvalidInputError
from nerfnav.formats import PICTURES, list_folder, time_in_name
from nerfnav.tracking.sources.pictures import FileSource, TimedFile


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
    return [path for path in list_folder(folder) if path.suffix.lower() in PICTURES and path.is_file()]


def _time_of(path: Path) -> float:
    time = time_in_name(path.stem)
    if time is not None:
        return time
    raise InvalidInputError(
        f"the picture {path.name} tells no time: name pictures by theirs (in s with a point, or since 1970 "
        "in s, ms, us or ns), list them in rgb.txt (TUM), or say how many there are in a second (fps)"
    )
