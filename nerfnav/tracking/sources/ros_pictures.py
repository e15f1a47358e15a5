"""sensor_msgs/Image and CompressedImage as pictures, sensor_msgs/CameraInfo as a camera."""

from pathlib import PurePosixPath
from typing import Any

import numpy as np
import torch
from jaxtyping import UInt8
from torch import Tensor

from nerfnav.errors import InvalidInputError
from nerfnav.geometry import Camera, camera_of_matrices
from nerfnav.tracking.sources.decoded import GREY, decoded

IMAGE, COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"
"""Message types that hold pictures."""
_ORDERS = {"rgb8": (0, 1, 2), "bgr8": (2, 1, 0), "rgba8": (0, 1, 2), "bgra8": (2, 1, 0)}
"""Where red, green and blue stand in the pixels of an encoding."""
_GREY = ("mono8", "8UC1", "mono16", "16UC1")
_RECTIFIED = "image_rect"


def picture_of(message: Any, aspect: float | None = None) -> UInt8[Tensor, "height width 3"]:
    """The picture of an Image or CompressedImage, RGB; `aspect` as `decoded` has it.

    Grey pictures are refused: fields are compared in colour. Raises InvalidInputError, which does not name the file.
    """
    if hasattr(message, "encoding"):
        return _raw(message)
    return decoded(message.data, "compressed rgb" in message.format, aspect)


def _raw(message: Any) -> UInt8[Tensor, "height width 3"]:
    encoding, height, width, step = message.encoding, int(message.height), int(message.width), int(message.step)
    if encoding in _GREY:
        raise InvalidInputError(f"it is grey ({encoding}), and {GREY}")
    if encoding not in _ORDERS:
        raise InvalidInputError(f"its encoding {encoding!r} is not known here; known are {', '.join(_ORDERS)}")
    stored, channels = np.frombuffer(message.data, np.uint8), 4 if "a" in encoding else 3
    if min(height, width) < 1 or step < width * channels or stored.size < step * height:
        raise InvalidInputError(
            f"it says {width} x {height} pixels of {encoding} in rows of {step} bytes, and has {stored.size} bytes"
        )
    rows = stored[: step * height].reshape(height, step)[:, : width * channels].reshape(height, width, channels)
    return torch.from_numpy(rows[..., list(_ORDERS[encoding])].copy())


def camera_of(message: Any, topic: str) -> Camera | None:
    """The camera that a CameraInfo tells for a topic of pictures; None where it says that it is not calibrated.

    Pictures of a topic named image_rect... are rectified: theirs is the projection P, without distortion.
    Raises InvalidInputError for a lens of another model.
    """
    if not np.any(message.k):
        return None
    rectified = PurePosixPath(topic.removesuffix("/compressed")).name.startswith(_RECTIFIED)
    matrix = np.reshape(message.p, (3, 4))[:, :3] if rectified else message.k
    told = {"image_width": message.width, "image_height": message.height, "camera_matrix": np.ravel(matrix).tolist()}
    if not rectified:
        told |= {"distortion_model": message.distortion_model, "distortion_coefficients": list(map(float, message.d))}
    return camera_of_matrices(told)
