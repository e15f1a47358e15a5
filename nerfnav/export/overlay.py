"""Overlay video of a track: the picture, what the field shows from the tracked pose, and their difference."""

from pathlib import Path
from types import TracebackType

import cv2
import numpy as np
import torch
from jaxtyping import UInt8
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.tracking import TrackedFrame

_GAIN = 3.0
"""The difference is shown so many times as large."""
_COLORS = {True: (255, 255, 255), False: (255, 80, 80)}
"""Text colour: white for a pose from the picture, red for none."""


class OverlayVideo:
    """Writes an MP4 file, one frame after the other; a context manager."""

    def __init__(self, path: Path, fps: float) -> None:
        """Prepare the file; `fps` is the frame rate [1/s]."""
        self._path, self._fps, self._size = path, fps, (0, 0)
        self._writer: cv2.VideoWriter | None = None

    def __enter__(self) -> "OverlayVideo":
        """Itself."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        """End the file."""
        if self._writer is not None:
            self._writer.release()

    def add(
        self,
        tracked: TrackedFrame,
        picture: UInt8[Tensor, "height width 3"],
        shown: UInt8[Tensor, "height width 3"] | None,
    ) -> None:
        """Add a frame; `shown` is what the field shows, None where no pose is known.

        Raises InvalidInputError where this machine's OpenCV cannot write MP4.
        """
        dark = torch.zeros_like(picture)
        off = dark if shown is None else (_GAIN * (picture.int() - shown.int()).abs()).clamp_max(255).to(torch.uint8)
        row = torch.cat([picture, dark if shown is None else shown, off], 1).numpy().copy()
        words = f"{tracked.time:.2f} s  {tracked.status.name.lower().replace('_', ' ')}{_accuracy_text(tracked)}"
        cv2.putText(row, words, (6, 16), cv2.FONT_HERSHEY_SIMPLEX, 0.45, _COLORS[tracked.status.updated], 1)
        self._open(row).write(np.ascontiguousarray(row[..., ::-1]))

    def _open(self, row: np.ndarray) -> cv2.VideoWriter:
        if self._writer is None:
            code = cv2.VideoWriter.fourcc(*"mp4v")
            self._writer = cv2.VideoWriter(str(self._path), code, self._fps, (row.shape[1], row.shape[0]))
            if not self._writer.isOpened():
                raise InvalidInputError(
                    f"{self._path} cannot be written: OpenCV here has no MPEG-4; leave the pictures out"
                )
        return self._writer


def _accuracy_text(tracked: TrackedFrame) -> str:
    if tracked.covariance is None:
        return ""
    deviations = tracked.covariance.diagonal().sqrt()
    return f"  +- {100 * float(deviations[:3].max()):.1f} cm, {float(deviations[3:].max().rad2deg()):.1f} deg"
