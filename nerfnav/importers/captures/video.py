"""Video capture: choose sharp frames that overlap, and pose them by structure from motion.

A window of frames ends where the picture has moved on by a share of its diagonal, by dense optical flow between small
pictures (Kroeger et al., 2016). Of each window the frame is chosen whose Laplacian of brightness, at a quarter of a
megapixel, has the largest variance: motion blur takes that away. Where windows are too many, neighbours are taken
together.
"""

from collections.abc import Generator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from nerfnav.core.errors import InvalidInputError
from nerfnav.core.jit import default_threads
from nerfnav.importers.captures.views import CaptureError
from nerfnav.importers.core.progress import ImportStep
from nerfnav.importers.core.video_frames import count_frames, read_video
from nerfnav.importers.sfm.posing import estimate_poses

_JUDGED_PIXELS = 250_000
"""Size of pictures whose sharpness is compared."""
_FLOW = (160, 120)
"""Width and height of pictures for optical flow, whatever the shape of the video."""
_LONGEST = 1920
_ALIKE = 0.5
"""Correlation of brightness, after optical flow, below which two frames show different things."""
_LEAST_SHARE = 0.3
"""Share of the frames that must be given a pose: fewer are a part of the place."""
_LEAST_POINTS = 50
"""Points that three of them see: fewer are found by chance where a camera turns on the spot."""
_CHOOSING = 0.2
"""Share of the progress in which frames are chosen."""
_LOOKS = 8
"""Frames that are looked at for each that is taken, at most: more only take time."""
_EVERY = 10  # frames between two reports


@dataclass(frozen=True)
class VideoConfig:
    """Options of the conversion of a video to a capture."""

    frames: int = 150
    """Frames that are taken, at most."""
    least_frames: int = 8
    """Frames that a video must have, each of which shows something else."""
    step: float = 0.01
    """Share of the picture's diagonal by which windows of frames move on."""


@dataclass(frozen=True)
class ChosenFrame:
    """A frame that was chosen of a video."""

    path: Path
    """Its JPEG, named by its place in the video."""
    sharpness: float
    """Variance of the Laplacian of its brightness."""
    brightness: float
    """Median of its brightness, 0 to 255."""


@dataclass(frozen=True)
class VideoReport:
    """Report of the conversion of a video."""

    frames: int
    """Frames that were chosen."""
    frames_posed: int
    """Frames of these that have a pose."""


def make_capture_of_video(
    video: Path, folder: Path, config: VideoConfig | None = None
) -> Generator[ImportStep, None, VideoReport]:
    """Write frames into `folder`/images and COLMAP's model into `folder`/sparse, which make it a capture.

    Raises CaptureError, in one sentence, where the video cannot be read or no poses can be found.
    """
    try:
        chosen = yield from choose_frames(video, folder / "images", config)
    except InvalidInputError as error:
        raise CaptureError(str(error)) from error
    posing = yield from estimate_poses(folder, default_threads(), _CHOOSING)
    posed = len(posing.model.poses)
    if posed < _LEAST_SHARE * len(chosen) or len(posing.model.points) < _LEAST_POINTS:
        reason = posing.explain_failure(float(np.median([frame.brightness for frame in chosen])))
        raise CaptureError(f"poses were found for {posed} of {len(chosen)} frames of {video}: {reason}")
    return VideoReport(len(chosen), posed)


def choose_frames(
    video: Path, folder: Path, config: VideoConfig | None = None
) -> Generator[ImportStep, None, list[ChosenFrame]]:
    """Write the sharpest frame of each window as a JPEG into `folder`, and return these.

    Raises InvalidInputError where the file is no video or ends in the middle, CaptureError where too few frames differ.
    """
    config = config or VideoConfig()
    folder.mkdir(parents=True, exist_ok=True)
    chosen: list[ChosenFrame] = []
    start, best, seen, windows, together = None, None, 0, -1, 1
    every = max(1, (count_frames(video) or 0) // (_LOOKS * config.frames))
    for frame in read_video(video, every):
        seen = frame.index + 1
        gray = brightness(frame.pixels)
        small, sharp = cv2.resize(gray, _FLOW, interpolation=cv2.INTER_AREA), sharpness(gray)
        if start is None or _has_moved(start, small, config.step):
            start, windows = small, windows + 1
            if len(chosen) == 2 * config.frames and windows % together == 0:
                chosen, together = _merged(chosen, config.frames), 2 * together
            if windows % together == 0:
                best = None
        if best is None or sharp > best.sharpness:
            if best is not None:
                chosen.pop().path.unlink()
            best = ChosenFrame(folder / f"{frame.index:06d}.jpg", sharp, float(np.median(small)))
            _write(best.path, frame.pixels)
            chosen.append(best)
        if frame.index % _EVERY == 0:
            yield ImportStep(f"choosing sharp frames: {len(chosen)} so far", _CHOOSING * frame.fraction)
    chosen = _merged(chosen, config.frames)
    if len(chosen) < config.least_frames:
        raise CaptureError(
            f"{video} has {seen} frames, of which {len(chosen)} differ, and {config.least_frames} are needed: walk "
            "around what you film, for longer"
        )
    return chosen


def brightness(frame: np.ndarray) -> np.ndarray:
    """Brightness (height, width) of a frame, shrunk to a number of pixels that is the same for all."""
    shrink = min(1.0, (_JUDGED_PIXELS / (frame.shape[0] * frame.shape[1])) ** 0.5)
    small = cv2.resize(frame, None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA)
    return cv2.cvtColor(small, cv2.COLOR_BGR2GRAY)


def sharpness(gray: np.ndarray) -> float:
    """Variance of the Laplacian of a picture's brightness (height, width)."""
    return float(cv2.Laplacian(gray, cv2.CV_32F).var())


def _has_moved(before: np.ndarray, now: np.ndarray, step: float) -> bool:
    """True where a picture moved on by a share of its diagonal, or shows something else."""
    flow = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_ULTRAFAST).calc(before, now, None)  # type: ignore[call-overload]
    if np.linalg.norm(flow / _FLOW, axis=2).mean() >= step * np.sqrt(2):
        return True
    rows, columns = np.indices(before.shape, np.float32)
    followed = cv2.remap(now, columns + flow[..., 0], rows + flow[..., 1], cv2.INTER_LINEAR)
    return bool(cv2.matchTemplate(followed, before, cv2.TM_CCOEFF_NORMED)[0, 0] < _ALIKE)


def _merged(chosen: list[ChosenFrame], count: int) -> list[ChosenFrame]:
    """At most so many frames: the sharpest of each group of neighbours; deletes the others."""
    if len(chosen) <= count:
        return chosen
    groups = np.array_split(np.arange(len(chosen)), count)
    kept = [max((chosen[index] for index in group), key=lambda frame: frame.sharpness) for group in groups]
    for frame in set(chosen) - set(kept):
        frame.path.unlink()
    return kept


def _write(path: Path, frame: np.ndarray) -> None:
    shrink = _LONGEST / max(frame.shape[:2])
    if shrink < 1:
        frame = cv2.resize(frame, None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA)
    if not cv2.imwrite(str(path), frame, [cv2.IMWRITE_JPEG_QUALITY, 95]):
        raise CaptureError(f"the frame {path} cannot be written: is the disk full?")
