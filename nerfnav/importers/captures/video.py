"""Video frames: make a capture of a video by its sharpest frames, posed by COLMAP where it is installed.

The video is cut into as many spans of equal length as frames are wanted; of each the frame is taken whose Laplacian,
brightness at a quarter of a megapixel, has the largest variance: motion blur takes that away.
"""

import importlib.util
import shutil
import subprocess
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from nerfnav.formats import ColmapModel
from nerfnav.importers.captures.views import CaptureError
from nerfnav.importers.core.kinds import identify_data, read_head
from nerfnav.importers.core.progress import ImportStep
from nerfnav.importers.core.stored_picture import open_video

_JUDGED_PIXELS = 250_000
_LONGEST = 1920
_LEAST_SHARE = 0.3
"""Share of the frames that must be given a pose: fewer are a part of the place."""
_MESSAGE = 200  # characters of a program's message in errors


@dataclass(frozen=True)
class VideoConfig:
    """Options of the conversion of a video to a capture."""

    frames: int = 150
    """Frames that are taken, at most."""
    least_frames: int = 8
    """Frames that a video must have."""


def make_capture_of_video(
    video: Path, folder: Path, config: VideoConfig | None = None
) -> Generator[ImportStep, None, None]:
    """Write frames into `folder`/images and COLMAP's model into `folder`/sparse, which make it a capture.

    Raises CaptureError, in one sentence, where the video cannot be read or no poses can be found.
    """
    poser = _poser()  # before long work
    for fraction in pick_frames(video, folder / "images", config):
        yield ImportStep("picking the sharpest frames", 0.3 * fraction)
    yield ImportStep("finding the camera's poses (COLMAP)", 0.3)
    (folder / "sparse").mkdir(exist_ok=True)
    poser(folder)
    _require_posed(video, folder)
    yield ImportStep("finding the camera's poses (COLMAP)", 1.0)


def pick_frames(video: Path, folder: Path, config: VideoConfig | None = None) -> Iterator[float]:
    """Write the sharpest frame of each span as a JPEG into `folder`; yields the share that is done.

    Raises CaptureError where the file is no video, ends in the middle, or is too short.
    """
    config = config or VideoConfig()
    reader = open_video(video)
    try:
        count = int(reader.get(cv2.CAP_PROP_FRAME_COUNT)) if reader.isOpened() else 0
        if count <= 0:
            named = identify_data(read_head(video)) or "of another kind"
            raise CaptureError(f"{video} cannot be read as a video: it is {named}, cut off, or of an unknown codec")
        spans = min(config.frames, count)
        folder.mkdir(parents=True, exist_ok=True)
        written, best, sharpest, seen = 0, None, -1.0, 0
        while reader.grab():
            read, frame = reader.retrieve()
            if read and (sharp := sharpness(frame)) > sharpest:
                best, sharpest = frame, sharp
            seen += 1
            if seen * spans >= (written + 1) * count and best is not None:
                _write(folder / f"{written:05d}.jpg", best)
                written, best, sharpest = written + 1, None, -1.0
                yield min(1.0, seen / count)
    finally:
        reader.release()
    if seen < 0.9 * count:
        raise CaptureError(f"{video} is cut off: it declares {count} frames, and {seen} can be read")
    if written < config.least_frames:
        raise CaptureError(f"{video} has {written} frames; at least {config.least_frames} are needed")


def sharpness(frame: np.ndarray) -> float:
    """Variance of the Laplacian of a picture's brightness (height, width, 3), at a size that is the same for all."""
    height, width = frame.shape[:2]
    shrink = min(1.0, (_JUDGED_PIXELS / (height * width)) ** 0.5)
    gray = cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY)
    small = cv2.resize(gray, None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA)
    return float(cv2.Laplacian(small, cv2.CV_32F).var())


def _write(path: Path, frame: np.ndarray) -> None:
    shrink = _LONGEST / max(frame.shape[:2])
    if shrink < 1:
        frame = cv2.resize(frame, None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA)
    if not cv2.imwrite(str(path), frame, [cv2.IMWRITE_JPEG_QUALITY, 95]):
        raise CaptureError(f"the frame {path} cannot be written: is the disk full?")


def _poser() -> Callable[[Path], None]:
    """Function that estimates the poses on this machine. Raises CaptureError where COLMAP is not installed."""
    if shutil.which("colmap"):
        return _by_binary
    if importlib.util.find_spec("pycolmap"):
        return _by_pycolmap
    raise CaptureError(
        "a video has no poses, and what finds them is not installed: install COLMAP (its program, or `pip install "
        "pycolmap`), or bring a capture with poses (Polycam, Record3D, nerfstudio)"
    )


def _by_binary(folder: Path) -> None:
    database, images, sparse = folder / "database.db", folder / "images", folder / "sparse"
    shared = ["--database_path", str(database)]
    for command in (
        ["feature_extractor", *shared, "--image_path", str(images), "--ImageReader.single_camera", "1",
         "--ImageReader.camera_model", "OPENCV"],
        ["sequential_matcher", *shared],
        ["mapper", *shared, "--image_path", str(images), "--output_path", str(sparse)],
    ):  # fmt: skip
        done = subprocess.run(["colmap", *command], capture_output=True, text=True, errors="replace", check=False)
        if done.returncode:
            last = (done.stderr or done.stdout).strip()[-_MESSAGE:].replace("\n", " ")
            raise CaptureError(f"`colmap {command[0]}` failed: {last or f'exit code {done.returncode}'}")


def _by_pycolmap(folder: Path) -> None:
    pycolmap: Any = importlib.import_module("pycolmap")  # few people have it
    database, images, sparse = folder / "database.db", folder / "images", folder / "sparse"
    try:
        reader = pycolmap.ImageReaderOptions(camera_model="OPENCV")
        pycolmap.extract_features(database, images, camera_mode=pycolmap.CameraMode.SINGLE, reader_options=reader)
        pycolmap.match_sequential(database)
        pycolmap.incremental_mapping(database, images, sparse)
    except (RuntimeError, ValueError, TypeError, OSError) as error:
        raise CaptureError(f"pycolmap failed: {str(error)[:_MESSAGE]}") from error


def _require_posed(video: Path, folder: Path) -> None:
    """Raise CaptureError where the largest of the models that COLMAP made, which counts, has poses of few frames."""
    models = (ColmapModel(place.parent) for place in (folder / "sparse").glob("*/images.bin"))
    posed = max((len(model.images()) for model in models), default=0)
    frames = len(list((folder / "images").iterdir()))
    if posed < _LEAST_SHARE * frames or posed == 0:
        raise CaptureError(
            f"COLMAP found poses for {posed} of {frames} frames of {video}: film slowly, in good light, from many "
            "places, without jumps"
        )
