"""Pictures in the bytes of a file."""

from typing import Any

import torch
from jaxtyping import UInt8
from torch import Tensor

from nerfnav.errors import InvalidInputError
from nerfnav.importers import read_picture

GREY = "fields are compared in colour: record rgb8 or bgr8"
"""What is said of pictures without colours."""


def decoded(data: Any, swapped: bool = False, aspect: float | None = None) -> UInt8[Tensor, "height width 3"]:
    """The picture in the bytes of a JPEG or PNG file, RGB; `swapped`: whoever wrote it took red for blue.

    `aspect` is the width over the height of its camera, where that is known: see importers/stored_picture.py. Raises
    InvalidInputError for other bytes, and for a picture that is not of colours of 8 bits.
    """
    picture = read_picture(bytes(data), aspect)
    if not picture.colored:
        raise InvalidInputError(f"it is grey or deeper than 8 bits, and {GREY}")
    colors = picture.pixels[..., 2::-1] if swapped else picture.pixels[..., :3]
    return torch.from_numpy(colors.copy())
