"""Pictures in the bytes of a file."""

from typing import Any

import cv2
import numpy as np
import torch
from jaxtyping import UInt8
from torch import Tensor

from nerfnav.errors import InvalidInputError

GREY = "fields are compared in colour: record rgb8 or bgr8"
"""What is said of pictures without colours."""


def decoded(data: Any, swapped: bool = False) -> UInt8[Tensor, "height width 3"]:
    """The picture in the bytes of a JPEG or PNG file, RGB; `swapped`: whoever wrote it took red for blue.

    Raises InvalidInputError for other bytes, and for a picture that is not of colours of 8 bits.
    """
    stored = np.frombuffer(data, np.uint8)
    pixels = cv2.imdecode(stored, cv2.IMREAD_UNCHANGED) if stored.size else None
    if pixels is None:
        raise InvalidInputError("it is no whole JPEG or PNG picture")
    if pixels.ndim != 3 or pixels.shape[2] not in (3, 4) or pixels.dtype != np.uint8:
        raise InvalidInputError(f"it is grey or deeper than 8 bits, and {GREY}")
    return torch.from_numpy(np.ascontiguousarray(pixels[..., :3] if swapped else pixels[..., 2::-1]))
