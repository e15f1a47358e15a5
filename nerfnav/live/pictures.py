"""Decode the pictures of messages. They come from outside: nothing is unpacked before its size is known."""

import io

import numpy as np
import torch
from jaxtyping import UInt8
from PIL import Image
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry import Camera
from nerfnav.live.messages import Picture
from nerfnav.tracking.sources.pictures import decode_picture

_MOST_PIXELS = 1 << 24


def pixels_of(message: Picture, camera: Camera) -> UInt8[Tensor, "height width 3"]:
    """The picture of a message, RGB. Raises InvalidInputError where it is none, or of other proportions."""
    width, height = size = _size(message)
    if min(size) < 1 or width * height > _MOST_PIXELS:
        raise InvalidInputError(f"pictures have at most {_MOST_PIXELS} pixels, not {width} x {height}")
    if message.encoding in ("jpeg", "png"):
        try:
            picture = decode_picture(message.data, aspect=camera.aspect)
        except InvalidInputError as error:
            raise InvalidInputError(f"the picture of {message.time:.3f} s cannot be used: {error}") from error
        camera.for_picture(picture.shape[1], picture.shape[0])
        return picture
    camera.for_picture(width, height)
    if len(message.data) != 3 * width * height:
        raise InvalidInputError(
            f"{width} x {height} pixels of {message.encoding} are {3 * width * height} bytes, not {len(message.data)}"
        )
    rows = np.frombuffer(message.data, np.uint8).reshape(height, width, 3)
    return torch.from_numpy((rows if message.encoding == "rgb8" else rows[..., ::-1]).copy())


def _size(message: Picture) -> tuple[int, int]:
    """Width and height [pixels], as the message or the head of its file says."""
    if message.encoding not in ("jpeg", "png"):
        if message.size is None:
            raise InvalidInputError(f"a picture in {message.encoding} needs its size: width and height")
        return message.size.width, message.size.height
    try:
        with Image.open(io.BytesIO(message.data), formats=[message.encoding]) as picture:
            return picture.size
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise InvalidInputError(f"the picture of {message.time:.3f} s is no {message.encoding} file") from error
