"""Camera tracks: the track of a camera as far as it has come, and the commands on it."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from nerfnav.geometry import encode_image
from nerfnav.tracking import TrackedFrame
from nerfnav_app.jobs.events import FrameTracked

_QUALITY = 85
"""Of the pictures that are kept, as JPEG: a track has thousands."""


@dataclass(frozen=True)
class StartTrack:
    """Track the camera that took the pictures of a file."""

    source: Path
    """Video, or folder of pictures."""
    name: str
    """Its name for the user."""
    fps: float | None = None
    """Pictures per second, where they carry no times."""
    fov_deg: float | None = None
    """Horizontal field of view [degrees]; None: as the place or the pictures have it."""


@dataclass(frozen=True)
class RemoveTrack:
    """Remove the track from the page."""


TrackAction = StartTrack | RemoveTrack


@dataclass(frozen=True)
class FrameRecord:
    """A picture and the tracked pose of its camera."""

    tracked: TrackedFrame
    seen: bytes = field(repr=False)
    """The picture, as a JPEG file."""
    shown: bytes | None = field(repr=False)
    """The field rendered from that pose, likewise; None where the pose is unknown."""

    @property
    def time(self) -> float:
        """Of its exposure [s]."""
        return self.tracked.time


@dataclass(frozen=True)
class TrackRecord:
    """A track as far as it has come."""

    name: str
    """Name of what was tracked."""
    steps: tuple[FrameRecord, ...] = ()
    """Its frames so far."""
    summary: dict[str, Any] = field(default_factory=dict)
    """Figures of the job, once it has finished."""

    @property
    def times(self) -> tuple[float, ...]:
        """Since the first frame [s]."""
        return tuple(step.time - self.steps[0].time for step in self.steps)

    @property
    def tick(self) -> float:
        """Resolution of its times [s]."""
        return 0.01

    @property
    def track(self) -> tuple[TrackedFrame, ...]:
        """Return its frames without their pictures."""
        return tuple(step.tracked for step in self.steps)

    def cut(self, at: int) -> "TrackRecord":
        """Return the track up to frame `at`."""
        return replace(self, steps=self.steps[: at + 1])

    def with_frame(self, event: FrameTracked) -> "TrackRecord":
        """Add a frame that was tracked."""
        assert event.seen is not None, "the page shows what it tracks"
        shown = None if event.shown is None else encode_image(event.shown.numpy(), _QUALITY)
        frame = FrameRecord(event.tracked, encode_image(event.seen.numpy(), _QUALITY), shown)
        return replace(self, steps=(*self.steps, frame))
