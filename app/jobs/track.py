"""Track: where a camera was while it took pictures."""

from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from itertools import chain, pairwise
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import UInt8
from torch import Tensor

from app.jobs.events import JobEvents, JobResult, Progress
from app.jobs.given_picture import GivenCamera, camera_of
from app.places.opening import field_file
from app.storage.output_files import prepare_folder, write_text
from nerfnav.errors import InvalidInputError
from nerfnav.export.overlay import OverlayVideo
from nerfnav.export.ros.track import TrackRecorder
from nerfnav.export.track import csv_of_track, tum_of_track
from nerfnav.field import Field, FieldInfo, load_field, render_image
from nerfnav.geometry import Camera
from nerfnav.geometry.similarity import Similarity
from nerfnav.tracking import Frame, FrameSource, Tracked, Tracker, TrackerConfig, TrackStatus
from nerfnav.tracking.sources.open_source import SourceOptions, open_source

_OVERLAY, _RECORDING = "overlay.mp4", "track.mcap"
_FPS = 15.0
"""How fast an overlay is played whose source does not tell its rate."""


@dataclass(frozen=True)
class TrackRequest:
    """What to track."""

    place: str
    """Name of a bundled scene, or path of a field."""
    source: Path
    """Video, folder of pictures, or recording."""
    out: Path
    """Folder for the results."""
    camera: GivenCamera = field(default_factory=GivenCamera)
    """What is known of the camera beside what the source says."""
    options: SourceOptions = field(default_factory=SourceOptions)
    """What the source leaves open."""
    pictures: bool = True
    """Whether the overlay and the recording are written, which hold pictures."""


def run(request: TrackRequest) -> JobEvents:
    """Yield progress; write the results and return their numbers.

    Raises NerfnavError for what cannot be tracked; what was tracked before a source broke off is written all the same.
    """
    place, source = load_field(field_file(request.place)), open_source(request.source, request.options)
    first, frames = _begun(source, request.source)
    camera, told = _camera(source, first, request.camera, place.info)
    out = prepare_folder(request.out)
    tracker = Tracker(place, camera, config=TrackerConfig().for_field(place.info))
    track: list[Tracked] = []
    broken: InvalidInputError | None = None
    with ExitStack() as stack:
        viewers = [stack.enter_context(viewer) for viewer in _viewers(request, out)]
        try:
            for frame in frames:
                tracked = tracker.observe(frame)
                track.append(tracked)
                if viewers:
                    picture = tracker.fitted(frame.picture)
                    shown = _shown(place, tracker.compared, tracked)
                    for viewer in viewers:
                        viewer.add(tracked, picture, shown)
                yield Progress(tracked.status.name.lower().replace("_", " "), _share(source, len(track)))
        except InvalidInputError as error:
            broken = error
    files = _written(track, place.info, out)
    if broken is not None:
        kept = f"; what was tracked until then is in {out}" if track else ""
        raise InvalidInputError(f"{broken}{kept}")
    pictures = (out / _OVERLAY, out / _RECORDING) if request.pictures else ()
    return JobResult({**summary_of(track), "camera": told, "frame": _frame_in_words(place.info)}, (*files, *pictures))


def summary_of(track: list[Tracked]) -> dict[str, Any]:
    """What `track --json` prints: how many frames, and what became of them; times are of updates."""
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


def _found_at_once(track: list[Tracked]) -> int:
    """Times that a track was lost and found again with the same frame."""
    return sum(before.status.knows and now.status is TrackStatus.FOUND_AGAIN for before, now in pairwise(track))


def _begun(source: FrameSource, path: Path) -> tuple[Frame, Iterator[Frame]]:
    """The first frame, and all of them. Raises InvalidInputError where there is none."""
    frames = source.frames()
    first = next(frames, None)
    if first is None:
        raise InvalidInputError(f"{path} has no pictures")
    return first, chain([first], frames)


def _camera(source: FrameSource, first: Frame, given: GivenCamera, info: FieldInfo) -> tuple[Camera, str]:
    if source.camera is not None and given == GivenCamera():
        height, width, _ = first.picture.shape
        return source.camera.for_picture(width, height), "what the source says"
    return camera_of(first.picture, given, info.camera)


def _viewers(request: TrackRequest, out: Path) -> list[OverlayVideo | TrackRecorder]:
    if not request.pictures:
        return []
    about = {"made by": "nerfnav", "field": request.place, "source": request.source.name, "camera": "OpenCV axes"}
    overlay = OverlayVideo(out / _OVERLAY, request.options.fps or _FPS)
    return [overlay, TrackRecorder(out / _RECORDING, about)]


def _shown(place: Field, camera: Camera, tracked: Tracked) -> UInt8[Tensor, "height width 3"] | None:
    if tracked.pose is None:
        return None
    return render_image(place, camera, tracked.pose).image


def _written(track: list[Tracked], info: FieldInfo, out: Path) -> tuple[Path, ...]:
    frame = Similarity.of_numbers(info.placed).inverted() if info.placed else Similarity.identity()
    return (
        write_text(out / "trajectory.tum", tum_of_track(track, frame)),
        write_text(out / "poses.csv", csv_of_track(track, frame)),
    )


def _frame_in_words(info: FieldInfo) -> str:
    if info.placed:
        return "poses are in the capture's own coordinates"
    return "poses are in the field's coordinates: it does not remember how it lies in its capture"


def _share(source: FrameSource, done: int) -> float:
    return 0.0 if not source.count else min(1.0, done / source.count)
