"""Video files: one reader of their frames for training and tracking, upright and with their own times.

Telephones film sideways and note the turn in the container, which the decoder applies. Their frames follow each other
at a variable rate, so that only the times say how much of a video was read; a recording that was streamed into its file
declares no length at all.
"""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from nerfnav.core.errors import InvalidInputError
from nerfnav.importers.core.kinds import identify_data, read_head

_WHOLE = 0.9
"""Share of the declared length of which a whole video has more: containers tell it roughly."""

_SILENT = 0
"""OpenCV's level of logging at which it says nothing."""

os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
# read once, before the first video: else the decoder writes complaints of its own beside the one sentence of a reader


@dataclass(frozen=True, eq=False)
class VideoFrame:
    """A frame of a video."""

    index: int
    """Its place in the video, from 0."""
    pixels: np.ndarray
    """Colours (height, width, 3), 0 to 255, BGR, upright."""
    seconds: float
    """Time since the start [s], as the container tells it."""
    fraction: float
    """Share of the video up to here, 0 to 1; 0 where no length is declared."""


def count_frames(path: Path) -> int | None:
    """Return how many frames a video declares; None where it declares none, as a recording that was streamed.

    Raises InvalidInputError where it cannot be read as a video.
    """
    reader = _open(path)
    count = int(reader.get(cv2.CAP_PROP_FRAME_COUNT))
    reader.release()
    return count if count > 0 else None


def read_video(path: Path, every: int = 1) -> Iterator[VideoFrame]:
    """Read the frames of a video in their order, or one of every so many.

    Raises InvalidInputError where it cannot be read as a video, and after its frames where it ends early.
    """
    reader = _open(path)
    try:
        count, rate = reader.get(cv2.CAP_PROP_FRAME_COUNT), reader.get(cv2.CAP_PROP_FPS)
        declared_s = count / rate if count > 0 and rate > 0 else 0.0
        index, seconds, grabbed = 0, 0.0, True
        while grabbed:
            seconds = 1e-3 * reader.get(cv2.CAP_PROP_POS_MSEC)
            whole, pixels = reader.retrieve() if index % every == 0 else (False, None)
            if whole and pixels is not None:
                yield VideoFrame(index, pixels, seconds, min(1.0, seconds / declared_s) if declared_s else 0.0)
            index, grabbed = index + 1, reader.grab()
    finally:
        reader.release()
    if index < _WHOLE * count and seconds < _WHOLE * declared_s and not _is_trimmed(path):
        raise InvalidInputError(
            f"{path} is cut off: it declares {count:.0f} frames ({declared_s:.1f} s), and {index} ({seconds:.1f} s) "
            "can be read"
        )


def _is_trimmed(path: Path) -> bool:
    """True for an MP4 or MOV file with all its boxes: its edit list leaves frames out that it declares."""
    head, size, at = read_head(path), path.stat().st_size, 0
    if head[4:8] != b"ftyp":
        return False
    with path.open("rb") as file:
        while at + 8 <= size:
            file.seek(at)
            box = file.read(16).ljust(16, b"\0")
            length = int.from_bytes(box[:4], "big")
            length = int.from_bytes(box[8:], "big") if length == 1 else length or size - at
            at += max(8, length)
    return at == size


def _open(path: Path) -> cv2.VideoCapture:
    """Open a video and grab its first frame. Raises InvalidInputError where there is none."""
    log: Any = getattr(cv2.utils, "logging", cv2)  # OpenCV 4 has it at the top
    before = log.setLogLevel(_SILENT)
    try:
        reader = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)  # other readers take it for a series of pictures
        if reader.isOpened() and reader.grab():
            return reader
    finally:
        log.setLogLevel(before)
    reader.release()
    named = identify_data(read_head(path)) or "of another kind"
    raise InvalidInputError(
        f"{path} cannot be read as a video: it is {named}, empty, cut off, or of an unknown codec"
    )
