"""Camera run: track a camera through a field frame by frame, as a part of the jobs that track one."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path
from typing import Any

from nerfnav.core.errors import InvalidInputError
from nerfnav.field import FieldInfo, StoredField, render_image
from nerfnav.geometry import Camera
from nerfnav.tracking import Frame, FrameSource, SourceOptions, Tracker, TrackerConfig, open_source
from nerfnav_app.jobs.events import FrameTracked, JobEvent, Progress
from nerfnav_app.jobs.track.camera import GivenCamera, camera_of
from nerfnav_app.jobs.track.imu import GivenImu, describe_biases


@dataclass(frozen=True)
class CameraRun:
    """Pictures of a camera, and given data of it."""

    source: Path
    """Video, folder of pictures, or recording."""
    camera: GivenCamera = field(default_factory=GivenCamera)
    """Given data of the camera, beside those of the source."""
    options: SourceOptions = field(default_factory=SourceOptions)
    """Options of the source."""
    imu: GivenImu | None = None
    """The inertial measurement unit that leads from picture to picture; None: a hand's motion does."""


@dataclass(frozen=True)
class TrackedCamera:
    """A camera that is ready to be tracked."""

    place: StoredField
    """The map."""
    source: FrameSource
    """Its frames."""
    frames: Iterator[Frame]
    """Iterator over them."""
    tracker: Tracker
    """Tracker of its pose."""
    camera_origin: str
    """Origin of the intrinsics, in words."""

    @classmethod
    def begin(cls, place: StoredField, asked: CameraRun) -> "TrackedCamera":
        """Open the source and prepare the tracker. Raises NerfnavError for what cannot be tracked."""
        source = open_source(asked.source, replace(asked.options, aspect=asked.camera.aspect(place.info.camera)))
        frames = source.frames()
        first = next(frames, None)
        if first is None:
            raise InvalidInputError(f"{asked.source} has no pictures")
        camera, origin = _camera(source, first, asked.camera, place.info)
        config = TrackerConfig().for_field(place.info)
        if asked.imu is None:
            tracker = Tracker(place, camera, config=config)
        else:
            unit, mount = asked.imu.of(source, asked.source)
            unit.check(first.time)
            tracker = Tracker(place, camera, mount=mount, config=config, inertial=unit)
        return cls(place, source, chain([first], frames), tracker, origin)

    @property
    def learned(self) -> dict[str, Any]:
        """Estimated biases of the inertial measurement unit, for people; nothing without one."""
        return describe_biases(self.tracker.motion)

    def events(self, pictures: bool = True) -> Iterator[JobEvent]:
        """Each frame, with its pictures where they are wanted, and how far it is.

        Raises InvalidInputError where the source breaks off.
        """
        for done, frame in enumerate(self.frames, 1):
            tracked = self.tracker.observe(frame)
            if pictures:
                pose, seen = tracked.pose, self.tracker.fitted(frame.picture)
                shown = None if pose is None else render_image(self.place, self.tracker.compared, pose).image
                yield FrameTracked(tracked, seen, shown)
            else:
                yield FrameTracked(tracked)
            share = 0.0 if not self.source.count else min(1.0, done / self.source.count)
            yield Progress(tracked.status.name.lower().replace("_", " "), share)


def _camera(source: FrameSource, first: Frame, given: GivenCamera, info: FieldInfo) -> tuple[Camera, str]:
    if source.camera is not None and given == GivenCamera():
        height, width, _ = first.picture.shape
        return source.camera.for_picture(width, height), "what the source says"
    return camera_of(first.picture, given, info.camera)
