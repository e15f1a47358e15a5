"""Video: its frames with the times that its container tells."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import torch

from nerfnav.geometry import Camera
from nerfnav.importers.core.kinds import VIDEOS
from nerfnav.importers.core.video_frames import count_frames, read_video
from nerfnav.tracking.frame import Frame, ImuMeasurements
from nerfnav.tracking.sources.pictures import require_later


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
        return cls(path, count_frames(path), fps)

    def frames(self) -> Iterator[Frame]:
        """See FrameSource; raises InvalidInputError at the end of a video that ends early."""
        last = None
        for index, frame in enumerate(read_video(self.path)):
            seconds = frame.seconds if self.fps is None else index / self.fps
            last = require_later(seconds, last, f"frame {index} of {self.path.name}")
            yield Frame(seconds, torch.from_numpy(frame.pixels[..., ::-1].copy()), f"frame {index}")


def is_video(path: Path) -> bool:
    """Return True for a file with the suffix of a video."""
    return path.is_file() and path.suffix.lower() in VIDEOS
