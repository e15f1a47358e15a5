"""Lists of pictures with their times: TUM's rgb.txt, and transforms.json where it tells `time_s`.

TUM's RGB-D sequences have a line for each picture:

# timestamp filename
1305031102.175304 rgb/1305031102.175304.png

Of a transforms.json, times and the camera are read, and no poses.
"""

from pathlib import Path

from nerfnav.core.errors import InvalidInputError
from nerfnav.formats import (
    NamedFiles,
    camera_of_transforms,
    has_camera,
    parse_stamp,
    read_rows,
    read_transforms,
    time_of,
)
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
    files = NamedFiles(path.parent)
    listed = tuple(
        TimedFile(parse_stamp(row.cells[0], row.where), files.find(row.cells[1]))
        for row in read_rows(path, 2, named=True)
    )
    if not listed:
        raise InvalidInputError(f"the list {path} names no pictures")
    return FileSource(listed, aspect)


def is_capture_with_times(path: Path) -> bool:
    """Return True for a transforms.json, or its folder, of whose frames some have a time."""
    path = path / _CAPTURE if path.is_dir() else path
    if path.name != _CAPTURE or not path.is_file():
        return False
    return any(time_of(frame) is not None for frame in read_transforms(path)[0].frames)


def open_timed_capture(path: Path) -> FileSource:
    """The photographs of a capture, in the order of their times. Raises InvalidInputError where one tells none."""
    path = path / _CAPTURE if path.is_dir() else path
    record, files = read_transforms(path)[0], NamedFiles(path.parent)
    camera = camera_of_transforms(record, path) if has_camera(record) else None  # which took all of them
    listed = []
    for frame in record.frames:
        seconds = time_of(frame)
        if seconds is None:
            raise InvalidInputError(f"{frame.file_path} in {path} has no time_s, a number of seconds, and others have")
        listed.append(TimedFile(seconds, files.find_picture(frame.file_path)))
    return FileSource(tuple(sorted(listed)), None if camera is None else camera.aspect, camera)
