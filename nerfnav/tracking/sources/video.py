"""Video: its frames with the times that its container tells."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry import Camera
from nerfnav.importers.core.kinds import VIDEOS
from nerfnav.importers.core.stored_picture import open_video
from nerfnav.tracking.frame import Frame, ImuMeasurements
from nerfnav.tracking.sources.pictures import require_later

_WHOLE = 0.9
"""Share of the declared frames of which a whole video has more: containers count roughly."""


@dataclass(frozen=True)
class VideoSource:
    """Frames and their times (a FrameSource)."""

    path: Path
    """The video."""
    count: int | None
    """Frames that it declares."""
    fps: float | None = None
    """Frames in a second [1/s]; None: as the container says for each."""
    camera: Camera | None = None
    """Unknown."""
    inertial: ImuMeasurements | None = None
    """There is none."""

    @classmethod
    def of(cls, path: Path, fps: float | None = None) -> "VideoSource":
        """A video. Raises InvalidInputError where it cannot be read as one."""
        reader = open_video(path)
        count = int(reader.get(cv2.CAP_PROP_FRAME_COUNT)) if reader.isOpened() else -1
        readable = reader.isOpened() and reader.grab()
        reader.release()
        if not readable:
            raise InvalidInputError(f"{path} cannot be read as a video: it is cut off, empty, or of an unknown codec")
        return cls(path, count if count > 0 else None, fps)

    def frames(self) -> Iterator[Frame]:
        """See FrameSource; raises InvalidInputError at the end of a video that ends early."""
        reader, index, last = open_video(self.path), 0, None
        try:
            while True:
                read, pixels = reader.read()
                if not read:
                    break
                seconds = 1e-3 * reader.get(cv2.CAP_PROP_POS_MSEC) if self.fps is None else index / self.fps
                last = require_later(seconds, last, f"frame {index} of {self.path.name}")
                yield Frame(seconds, torch.from_numpy(pixels[..., ::-1].copy()), f"frame {index}")
                index += 1
        finally:
            reader.release()
        if self.count is not None and index < _WHOLE * self.count:
            raise InvalidInputError(f"{self.path} ends early: it declares {self.count} frames, and {index} can be read")


def is_video(path: Path) -> bool:
    """Return True for a file with the suffix of a video."""
    return path.is_file() and path.suffix.lower() in VIDEOS
