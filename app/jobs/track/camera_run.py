"""Camera run: track a camera through a field frame by frame, as a part of the jobs that track one."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from nerfnav.core.errors import InvalidInputError
from nerfnav.field import FieldInfo, StoredField, render_image
from nerfnav.geometry import Camera
from nerfnav.tracking import (
    CameraFit,
    Frame,
    FrameSource,
    SourceOptions,
    Tracker,
    TrackerConfig,
    camera_of_photographs,
    check_camera,
    open_source,
)
from nerfnav_app.jobs.events import FrameTracked, JobEvent, Progress
from nerfnav_app.jobs.track.camera import GivenCamera, camera_of, fit_camera
from nerfnav_app.jobs.track.camera_check import CalibrationFile, numbers_of_check, require_clear
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
    calibration: CalibrationFile | None = None
    """File for the camera that fits."""


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
    fit: CameraFit | None
    """Focal length that fits the first pictures; None where the camera was found in none of them."""

    @classmethod
    def begin(cls, place: StoredField, asked: CameraRun) -> "TrackedCamera":
        """Open the source, check the camera, and prepare the tracker. Raises NerfnavError for what cannot be tracked.

        A camera whose focal length is wrong is corrected where the right one is clear, else refused.
        """
        source = open_source(asked.source, replace(asked.options, aspect=asked.camera.aspect(place.info.camera)))
        first = next(source.frames(), None)
        if first is None:
            raise InvalidInputError(f"{asked.source} has no pictures")
        camera, origin = _camera(source, first, asked, place.info)
        if asked.calibration is not None:
            asked.calibration.prepare()
            asked.calibration.require_pictures(source, asked.source)
        config = TrackerConfig().for_field(place.info)
        if asked.imu is None:
            tracker = Tracker(place, camera, config=config)
        else:
            unit, mount = asked.imu.of(source, asked.source)
            try:
                unit.check(first.time)
            except InvalidInputError as error:
                raise InvalidInputError(f"{asked.source}: {error}") from error
            tracker = Tracker(place, camera, mount=mount, config=config, inertial=unit)
        fit = check_camera(tracker, source.frames, camera_of_photographs(place.info, camera))
        if fit is not None and not fit.ok:
            require_clear(fit)
            tracker, origin = tracker.with_camera(fit.fitted), f"{fit.sentence}; it was corrected"
        if asked.calibration is not None:
            asked.calibration.write(fit)
        return cls(place, source, source.frames(), tracker, origin, fit)

    @property
    def check(self) -> dict[str, Any]:
        """The numbers `camera` and `camera_check` of `track --json`."""
        return {"camera": self.camera_origin, "camera_check": numbers_of_check(self.fit, self.tracker.camera)}

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


def _camera(source: FrameSource, first: Frame, asked: CameraRun, info: FieldInfo) -> tuple[Camera, str]:
    if source.camera is not None and asked.camera == GivenCamera():
        return fit_camera(source.camera, first.picture, f"{first.name} of {asked.source}"), "what the source says"
    return camera_of(first.picture, asked.camera, info.camera)
