"""Registry of sources: open a path that holds pictures and their times by the first kind that takes it."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from nerfnav.core.errors import InvalidInputError
from nerfnav.tracking.frame import FrameSource
from nerfnav.tracking.sources.euroc import is_euroc, open_euroc
from nerfnav.tracking.sources.image_folder import is_folder_of_pictures, open_folder
from nerfnav.tracking.sources.ros_bag import is_bag, open_bag
from nerfnav.tracking.sources.timed_lists import is_capture_with_times, is_list, open_list, open_timed_capture
from nerfnav.tracking.sources.video import VideoSource, is_video


@dataclass(frozen=True)
class SourceOptions:
    """Options that a source may leave open."""

    fps: float | None = None
    """Pictures in a second, for those that tell no times."""
    topic: str | None = None
    """Name of the pictures that are meant, where there are several."""
    aspect: float | None = None
    """Width over height of the camera's pictures, where that is known and the source does not say."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for a rate that no camera has."""
        if self.fps is not None and not 0 < self.fps < 1e6:
            raise InvalidInputError(f"fps, pictures in a second, is a number above 0, not {self.fps:g}")


@dataclass(frozen=True)
class SourceKind:
    """One kind of source."""

    name: str
    """For people."""
    takes: Callable[[Path], bool]
    """Return True for a path of this kind, without reading it all."""
    open: Callable[[Path, SourceOptions], FrameSource]
    """Opens it. Raises InvalidInputError, in one sentence, where it cannot be used."""


KINDS: list[SourceKind] = [
    SourceKind("an MCAP file or a rosbag2", is_bag, lambda path, options: open_bag(path, options.topic)),
    SourceKind("an EuRoC (ASL) folder", is_euroc, lambda path, options: open_euroc(path, options.topic)),
    SourceKind("a video", is_video, lambda path, options: VideoSource.of(path, options.fps)),
    SourceKind("a folder with rgb.txt (TUM)", is_list, lambda path, options: open_list(path, options.aspect)),
    SourceKind("a capture with time_s in its transforms.json", is_capture_with_times,
               lambda path, _: open_timed_capture(path)),
    SourceKind("a folder of pictures named by their times [s with a point, or ns]", is_folder_of_pictures,
               lambda path, options: open_folder(path, options.fps, options.aspect)),
]  # fmt: skip
"""What is known, the special before the general."""


def open_source(path: Path, options: SourceOptions | None = None) -> FrameSource:
    """The pictures at a path. Raises InvalidInputError where there is nothing, or nothing that is known."""
    if not path.exists():
        raise InvalidInputError(f"there is no {path}")
    for kind in KINDS:
        if kind.takes(path):
            return kind.open(path, options or SourceOptions())
    if path.is_dir():
        raise InvalidInputError(f"{path} has no pictures to track: give {_known()}")
    raise InvalidInputError(f"{path} is nothing that can be tracked: give {_known()}")


def _known() -> str:
    return ", or ".join(kind.name for kind in KINDS)
