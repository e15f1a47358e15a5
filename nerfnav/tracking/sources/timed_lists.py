"""Lists of pictures with their times: TUM's rgb.txt, and transforms.json where it tells `time_s`.

TUM's RGB-D sequences have a line for each picture:

# timestamp filename
1305031102.175304 rgb/1305031102.175304.png

Of a transforms.json, times and the camera are read, and no poses.
"""

from pathlib import Path
from typing import Any

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry import read_camera
from nerfnav.importers.captures.transforms import read_frames
from nerfnav.tracking.sources.pictures import FileSource, TimedFile

_TUM, _CAPTURE = "rgb.txt", "transforms.json"


def is_list(path: Path) -> bool:
    """Return True for an rgb.txt, or a folder that holds one."""
    return path.name == _TUM or (path / _TUM).is_file()


def open_list(path: Path, aspect: float | None = None) -> FileSource:
    """The pictures of a folder's rgb.txt, or of a list itself, in the order in which they are listed.

    `aspect` is that of the camera, where it is known after all. Raises InvalidInputError for an unreadable line.
    """
    path = path / _TUM if path.is_dir() else path
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InvalidInputError(f"the list {path} cannot be read: {error}") from error
    listed = tuple(
        _from_line(line, f"line {number} of {path}", path.parent)
        for number, line in enumerate(lines, 1)
        if line.strip() and not line.startswith("#")
    )
    if not listed:
        raise InvalidInputError(f"the list {path} names no pictures")
    return FileSource(listed, aspect)


def _from_line(line: str, where: str, folder: Path) -> TimedFile:
    seconds, _, name = line.strip().partition(" ")
    try:
        return TimedFile(float(seconds), folder / name.strip())
    except ValueError as error:
        raise InvalidInputError(f"{where} is no time [s] and a file's name: {line.strip()[:80]!r}") from error


def is_capture_with_times(path: Path) -> bool:
    """Return True for a transforms.json, or its folder, of whose frames some have a time."""
    path = path / _CAPTURE if path.is_dir() else path
    if path.name != _CAPTURE or not path.is_file():
        return False
    return any("time_s" in frame for frame in read_frames(path)[1])


def open_timed_capture(path: Path) -> FileSource:
    """The photographs of a capture, in the order of their times. Raises InvalidInputError where one tells none."""
    path = path / _CAPTURE if path.is_dir() else path
    head, frames = read_frames(path)
    camera = read_camera(path) if "fl_x" in head else None  # which took all of them
    listed = tuple(sorted(_from_frame(frame, path) for frame in frames))
    return FileSource(listed, None if camera is None else camera.aspect, camera)


def _from_frame(frame: dict[str, Any], path: Path) -> TimedFile:
    seconds, name = frame.get("time_s"), frame.get("file_path")
    if isinstance(seconds, bool) or not isinstance(seconds, int | float) or seconds != seconds:
        raise InvalidInputError(f"{name} in {path} has no time_s, a number of seconds, and others have")
    if not isinstance(name, str):
        raise InvalidInputError(f"a frame of {path} has no file_path")
    return TimedFile(float(seconds), path.parent / name)
