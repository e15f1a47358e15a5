"""Camera tracks: the track of a camera as far as it has come, and a person's actions on it."""

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
    """Follow the camera that took the pictures of a file."""

    source: Path
    """Video, or folder of pictures."""
    name: str
    """What the user calls it."""
    fps: float | None = None
    """Pictures in a second, where they tell no times."""
    fov_deg: float | None = None
    """Horizontal field of view [degrees]; None: what the place or the pictures say."""


@dataclass(frozen=True)
class ForgetTrack:
    """Take the track off the page."""


TrackAction = StartTrack | ForgetTrack


@dataclass(frozen=True)
class FrameRecord:
    """A picture and where its camera was."""

    tracked: TrackedFrame
    seen: bytes = field(repr=False)
    """The picture, as a JPEG file."""
    shown: bytes | None = field(repr=False)
    """What the field shows from there, likewise; None where nobody knows where that is."""

    @property
    def time(self) -> float:
        """Of its exposure [s]."""
        return self.tracked.time


@dataclass(frozen=True)
class TrackRecord:
    """A track as far as it has come."""

    name: str
    """What was tracked."""
    steps: tuple[FrameRecord, ...] = ()
    """Its frames so far."""
    summary: dict[str, Any] = field(default_factory=dict)
    """The job's numbers, once it has finished."""

    @property
    def times(self) -> tuple[float, ...]:
        """Since the first frame [s]."""
        return tuple(step.time - self.steps[0].time for step in self.steps)

    @property
    def tick(self) -> float:
        """What times are told to [s]."""
        return 0.01

    @property
    def track(self) -> tuple[TrackedFrame, ...]:
        """Its frames without their pictures."""
        return tuple(step.tracked for step in self.steps)

    def cut(self, at: int) -> "TrackRecord":
        """Up to frame `at`."""
        return replace(self, steps=self.steps[: at + 1])

    def with_frame(self, event: FrameTracked) -> "TrackRecord":
        """With one more frame."""
        assert event.seen is not None, "the page shows what it tracks"
        shown = None if event.shown is None else encode_image(event.shown.numpy(), _QUALITY)
        frame = FrameRecord(event.tracked, encode_image(event.seen.numpy(), _QUALITY), shown)
        return replace(self, steps=(*self.steps, frame))
