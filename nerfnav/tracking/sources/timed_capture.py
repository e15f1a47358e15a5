"""Capture with times: transforms.json tells when each photograph was taken (`time_s`); its poses are not read."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry import Camera, read_camera
from nerfnav.importers.captures.transforms import read_frames
from nerfnav.tracking.frame import Frame, ImuMeasurements
from nerfnav.tracking.sources.pictures import TimedFile, pictures_of

_NAME = "transforms.json"


@dataclass(frozen=True)
class PosedSource:
    """Photographs and their times (a FrameSource)."""

    listed: tuple[TimedFile, ...]
    """Time [s] and file of each, in order."""
    camera: Camera | None
    """What the head of transforms.json says of it."""
    inertial: ImuMeasurements | None = None
    """There is none."""

    @classmethod
    def of(cls, path: Path) -> "PosedSource":
        """The photographs of a capture, in the order of their times. Raises InvalidInputError where one tells none."""
        path = path / _NAME if path.is_dir() else path
        head, frames = read_frames(path)
        camera = read_camera(path) if "fl_x" in head else None  # which took all of them
        return cls(tuple(sorted(_entry(frame, path) for frame in frames)), camera)

    @property
    def count(self) -> int:
        """Number of photographs of the capture."""
        return len(self.listed)

    def frames(self) -> Iterator[Frame]:
        """Yield each frame; see FrameSource."""
        return pictures_of(self.listed, None if self.camera is None else self.camera.aspect)


def is_capture_with_times(path: Path) -> bool:
    """Return True for a transforms.json, or its folder, of whose frames some have a time."""
    path = path / _NAME if path.is_dir() else path
    if path.name != _NAME or not path.is_file():
        return False
    return any("time_s" in frame for frame in read_frames(path)[1])


def _entry(frame: dict[str, Any], path: Path) -> TimedFile:
    seconds, name = frame.get("time_s"), frame.get("file_path")
    if isinstance(seconds, bool) or not isinstance(seconds, int | float) or seconds != seconds:
        raise InvalidInputError(f"{name} in {path} has no time_s, a number of seconds, and others have")
    if not isinstance(name, str):
        raise InvalidInputError(f"a frame of {path} has no file_path")
    return TimedFile(float(seconds), path.parent / name)
