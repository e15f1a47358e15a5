"""Camera and picture as given by the user: read the picture, find the intrinsics of its camera."""

import math
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import torch
from jaxtyping import UInt8
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.formats import read_camera
from nerfnav.geometry import Camera
from nerfnav.importers import read_picture
from nerfnav.importers.core.stored_picture import focal_35mm

_DIAGONAL_35MM = 43.27
"""Of 35 mm film [mm]."""
_TRIED = 33
"""Pixels along each side of a picture at which a distortion is undone."""


def read_image(path: Path, aspect: float | None = None) -> UInt8[Tensor, "height width 3"]:
    """A picture file as RGB; `aspect` is the width over the height of its camera, where that is known.

    Raises InvalidInputError where it is none.
    """
    if not path.is_file():
        raise InvalidInputError(f"there is no picture {path}")
    try:
        return torch.from_numpy(read_picture(path.read_bytes(), aspect).pixels[..., :3].copy())
    except (OSError, InvalidInputError) as error:
        raise InvalidInputError(f"{path} cannot be read as a picture: give a PNG or JPEG file") from error


@dataclass(frozen=True)
class GivenCamera:
    """Given data of the camera that took a picture; of several, the first that is given counts."""

    calibration: Path | None = None
    """Its calibration: see nerfnav/formats/camera_file.py."""
    intrinsics: tuple[float, float, float, float] | None = None
    """fx, fy, cx, cy [pixels]."""
    fov_deg: float | None = None
    """Horizontal field of view [degrees]."""

    def aspect(self, remembered: tuple[float, ...]) -> float | None:
        """Width over height of the camera's pictures, where it is known: `remembered` is what the field says of it."""
        if self.calibration is not None:
            return read_camera(self.calibration).aspect
        known = remembered and self.intrinsics is None and self.fov_deg is None
        return Camera.of_numbers(remembered).aspect if known else None


def fit_camera(camera: Camera, image: UInt8[Tensor, "height width 3"], where: str) -> Camera:
    """Fit a camera to the resolution of a picture, and check that its distortion can be undone.

    `where` names the file of the camera. Raises InvalidInputError for a picture of other proportions, and for a
    distortion that folds the picture.
    """
    height, width, _ = image.shape
    try:
        fitted = camera.for_picture(width, height)
        columns, rows = (torch.linspace(0, edge - 1, min(edge, _TRIED)).long() for edge in (width, height))
        fitted.directions(torch.cartesian_prod(columns, rows))  # which refuses what cannot be undone
    except InvalidInputError as error:
        raise InvalidInputError(f"{where}: {error}") from error
    return fitted


def camera_of(
    image: UInt8[Tensor, "height width 3"],
    given: GivenCamera,
    remembered: tuple[float, ...] = (),
    path: Path | None = None,
) -> tuple[Camera, str]:
    """The camera that took the picture, and in words where that was taken from.

    Where nothing is given it is the one that the field remembers, if the picture has its proportions; else the focal
    length in the picture's own EXIF; else 90 degrees. Raises InvalidInputError for numbers that no camera has.
    """
    height, width, _ = image.shape
    if given.calibration is not None:
        camera = read_camera(given.calibration)
        return fit_camera(camera, image, str(given.calibration)), f"calibration {given.calibration.name}"
    if given.intrinsics is not None:
        return Camera(width, height, *given.intrinsics), "the given intrinsics"
    if given.fov_deg is not None:
        return Camera.from_fov(width, height, given.fov_deg), "the given field of view"
    if remembered:
        with suppress(InvalidInputError):
            return Camera.of_numbers(remembered).for_picture(width, height), "the camera of the field's photographs"
    focal_mm = None if path is None else focal_35mm(path.read_bytes())
    if focal_mm is not None:
        focal = focal_mm * math.hypot(width, height) / _DIAGONAL_35MM
        return Camera(width, height, focal, focal, width / 2, height / 2), f"guessed: {focal_mm:g} mm by EXIF"
    return Camera.from_fov(width, height, 90), "guessed: 90 degrees"
