"""Pictures in files: decode them as their sensor gave them, and check that their times increase."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import torch
from jaxtyping import UInt8
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry import Camera
from nerfnav.importers import read_picture
from nerfnav.tracking.frame import Frame, ImuMeasurements


def require_later(time: float, last: float | None, what: str) -> float:
    """`time` [s], if it is a number after `last`; `what` was taken then, for people. Raises InvalidInputError."""
    if not (time > float("-inf") if last is None else time > last):
        before = "no earlier one" if last is None else f"{last:.6f} s"
        raise InvalidInputError(f"time must go on: {what} was taken at {time:.6f} s, and the one before at {before}")
    return time


GREY = "fields are compared in colour: record rgb8 or bgr8"
"""Message for pictures without colours."""


def decode_picture(data: Any, swapped: bool = False, aspect: float | None = None) -> UInt8[Tensor, "height width 3"]:
    """The picture in the bytes of a JPEG or PNG file, RGB; `swapped`: red and blue are exchanged.

    `aspect` is the width over the height of its camera, where that is known: see importers/core/stored_picture.py.
    Raises InvalidInputError for other bytes, and for a picture that is not of colours of 8 bits.
    """
    picture = read_picture(bytes(data), aspect)
    if not picture.colored:
        raise InvalidInputError(f"it is grey or deeper than 8 bits, and {GREY}")
    colors = picture.pixels[..., 2::-1] if swapped else picture.pixels[..., :3]
    return torch.from_numpy(colors.copy())


class TimedFile(NamedTuple):
    """File of a picture, with its time."""

    time: float
    """[s]"""
    path: Path
    """JPEG, PNG or another picture."""


@dataclass(frozen=True)
class FileSource:
    """Files of pictures and their times (a FrameSource)."""

    listed: tuple[TimedFile, ...]
    """Time [s] and file of each, in order."""
    aspect: float | None = None
    """Width over height of the camera, where that is known; as `decode_picture` has it."""
    camera: Camera | None = None
    """Camera of the pictures; None where it is unknown."""
    inertial: ImuMeasurements | None = None
    """Inertial measurements of the same time, if any."""

    @property
    def count(self) -> int:
        """Number of listed pictures."""
        return len(self.listed)

    def frames(self) -> Iterator[Frame]:
        """Yield each frame. Raises InvalidInputError where a time does not go on, or a file is missing or unusable."""
        last: float | None = None
        for seconds, path in self.listed:
            last = require_later(seconds, last, path.name)
            try:
                yield Frame(seconds, decode_picture(path.read_bytes(), aspect=self.aspect), path.name)
            except OSError as error:
                raise InvalidInputError(f"the picture {path} cannot be read: {error.strerror}") from error
            except InvalidInputError as error:
                raise InvalidInputError(f"{path} cannot be used: {error}") from error
