"""Track job: estimate the trajectory of a camera from its pictures, and report on its frames."""

from contextlib import ExitStack
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from nerfnav.core.errors import InvalidInputError
from nerfnav.export import OverlayVideo, TrackRecorder, texts_of_track
from nerfnav.field import FieldInfo, StoredField, load_field
from nerfnav.tracking import TrackedFrame, TrackStatus
from nerfnav_app.jobs.events import FrameTracked, JobEvents, JobResult, Progress
from nerfnav_app.jobs.track.camera_run import CameraRun, TrackedCamera
from nerfnav_app.places.place import field_file
from nerfnav_app.storage.output_files import prepare_folder, write_text


def summary_of(track: list[TrackedFrame]) -> dict[str, Any]:
    """Numbers of `track --json`: frames by status, and the times of updates."""
    times = [tracked.ms for tracked in track if tracked.status is TrackStatus.FOLLOWED]
    low, high = np.quantile(times, (0.5, 0.95)).tolist() if times else (None, None)
    known = [False, *(tracked.status.knows for tracked in track)]
    return {
        "frames": len(track),
        "updated": sum(tracked.status.updated for tracked in track),
        "lost": sum(before and not now for before, now in pairwise(known)) + _found_at_once(track),
        "found_again": sum(tracked.status is TrackStatus.FOUND_AGAIN for tracked in track),
        "ms_p50": low,
        "ms_p95": high,
    }


def _found_at_once(track: list[TrackedFrame]) -> int:
    """Times that a track was lost and found again with the same frame."""
    return sum(before.status.knows and now.status is TrackStatus.FOUND_AGAIN for before, now in pairwise(track))


_OVERLAY, _RECORDING = "overlay.mp4", "track.mcap"
_FPS = 15.0
"""Rate of an overlay whose source does not give one [1/s]."""


@dataclass(frozen=True)
class TrackRequest:
    """Request of a track: field, camera and folder."""

    place: str
    """Name of a bundled scene, or path of a field."""
    camera: CameraRun
    """Its pictures, and given data of it."""
    out: Path
    """Folder for the results."""
    pictures: bool = True
    """Write the overlay and the recording, which hold pictures."""


def run(request: TrackRequest) -> JobEvents:
    """Yield progress; write the results and return their numbers.

    Raises NerfnavError for what cannot be tracked; what was tracked before a source broke off is written all the same.
    """
    place = load_field(field_file(request.place))
    yield Progress("comparing the camera with the field", 0.0)
    following = TrackedCamera.begin(place, request.camera)
    out = prepare_folder(request.out)
    track: list[TrackedFrame] = []
    broken: InvalidInputError | None = None
    with ExitStack() as stack:
        viewers = [stack.enter_context(viewer) for viewer in _viewers(request, out)]
        try:
            for event in following.events(bool(viewers)):
                if isinstance(event, FrameTracked):
                    track.append(event.tracked)
                    for viewer in viewers:
                        assert event.seen is not None, "pictures were asked for"
                        viewer.add(event.tracked, event.seen, event.shown)
                else:
                    yield event
        except InvalidInputError as error:
            broken = error
    files = [write_text(out / name, text) for name, text in texts_of_track(track, place.info.placed).items()]
    if broken is not None:
        kept = f"; what was tracked until then is in {out}" if track else ""
        raise InvalidInputError(f"{broken}{kept}")
    pictures = (out / _OVERLAY, out / _RECORDING) if request.pictures else ()
    about = {**following.check, "frame": _frame_in_words(place.info), **following.learned}
    written = (*files, *pictures)
    return JobResult({**summary_of(track), **about, "files": [str(path) for path in written]}, written)


def watch(place: StoredField, asked: CameraRun) -> JobEvents:
    """Yield every frame as it is tracked in an open place; return the numbers of `track --json`. Writes nothing."""
    yield Progress("comparing the camera with the field", 0.0)
    following, track = TrackedCamera.begin(place, asked), []
    for event in following.events():
        if isinstance(event, FrameTracked):
            track.append(event.tracked)
        yield event
    return JobResult({**summary_of(track), **following.check})


def _viewers(request: TrackRequest, out: Path) -> list[OverlayVideo | TrackRecorder]:
    if not request.pictures:
        return []
    camera = request.camera
    about = {"made by": "nerfnav", "field": request.place, "source": camera.source.name, "camera": "OpenCV axes"}
    overlay = OverlayVideo(out / _OVERLAY, camera.options.fps or _FPS)
    return [overlay, TrackRecorder(out / _RECORDING, about)]


def _frame_in_words(info: FieldInfo) -> str:
    if info.placed:
        return "poses are in the capture's own coordinates"
    return "poses are in the field's coordinates: it does not remember how it lies in its capture"
