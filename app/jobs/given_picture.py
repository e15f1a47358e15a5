"""A picture that somebody gives, and the camera that took it."""

from pathlib import Path

import cv2
import torch
from jaxtyping import UInt8
from torch import Tensor

from nerfnav.errors import InvalidInputError
from nerfnav.geometry import Camera, read_camera


def read_image(path: Path) -> UInt8[Tensor, "height width 3"]:
    """A picture file as RGB. Raises InvalidInputError where it is none."""
    if not path.is_file():
        raise InvalidInputError(f"there is no picture {path}")
    pixels = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if pixels is None:
        raise InvalidInputError(f"{path} cannot be read as a picture: give a PNG or JPEG file")
    return torch.from_numpy(pixels[..., ::-1].copy())


def camera_of(
    image: UInt8[Tensor, "height width 3"], fov_deg: float, intrinsics: tuple[float, float, float, float] | None
) -> Camera:
    """The camera that took the picture: by fx, fy, cx, cy [pixels], else by its horizontal field of view [degrees].

    Raises InvalidInputError for numbers that no camera has.
    """
    height, width, _ = image.shape
    if intrinsics is None:
        return Camera.from_fov(width, height, fov_deg)
    fx, fy, cx, cy = intrinsics
    if not (fx > 0 and fy > 0):
        raise InvalidInputError(f"focal lengths are above 0 pixels, not {fx:g} and {fy:g}")
    return Camera(width, height, fx, fy, cx, cy)


def calibrated(image: UInt8[Tensor, "height width 3"], calibration: Path) -> Camera:
    """The calibrated camera at the resolution of the picture. Raises InvalidInputError for a picture of another shape.

    Several resolutions of one camera are one camera, as long as the picture is not cut.
    """
    camera, (height, width, _) = read_camera(calibration), image.shape
    if abs(camera.width * height - camera.height * width) > max(camera.width, width):  # a pixel of rounding
        raise InvalidInputError(
            f"{calibration} is the calibration of {camera.width} x {camera.height} pixels, and the picture has "
            f"{width} x {height}: give one of the same proportions"
        )
    return camera.resized(width, height)
