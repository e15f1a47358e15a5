"""Picture files (JPEG, PNG, ...): one reader for training, localization, tracking and live use.

A camera is a sensor: calibrations, and the poses that COLMAP and nerfstudio find, belong to the pixels as they are
stored, whatever the EXIF orientation. So where a camera's size is known and the stored pixels have its
proportions, they are taken as they are stored. Else the picture is turned upright by its EXIF orientation, as
viewers show it: where no camera is known, and where only the turned picture has the camera's proportions.
"""

import io
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nerfnav.core.errors import InvalidInputError
from nerfnav.core.files import LFS_POINTER, NOT_FETCHED

if TYPE_CHECKING:  # slow to import, and most starts read no picture
    from PIL import Image

_TURNS = {2: (0, True), 3: (2, False), 4: (2, True), 5: (1, True), 6: (3, False), 7: (3, True), 8: (1, False)}
"""EXIF orientation to quarter turns (counterclockwise), and whether left and right are swapped before them."""


@dataclass(frozen=True, eq=False)
class StoredPicture:
    """Decoded content of a picture file."""

    pixels: np.ndarray
    """Colours (height, width, 3) or colours and opacity (height, width, 4), 0 to 255, RGB."""
    colored: bool
    """True for 8-bit colours: grey and deeper pictures are converted."""


def read_picture(data: bytes, aspect: float | None = None) -> StoredPicture:
    """The picture in the bytes of a file; `aspect` is the width over the height of its camera, where that is known.

    Raises InvalidInputError where they are no whole picture.
    """
    from PIL import ExifTags, Image

    if data.startswith(LFS_POINTER):
        raise InvalidInputError(f"it is {NOT_FETCHED}")
    try:
        with Image.open(io.BytesIO(data)) as image:
            image.load()
            orientation = image.getexif().get(ExifTags.Base.Orientation)
            turns, mirrored = _TURNS.get(orientation if isinstance(orientation, int) else 1, (0, False))
            pixels, colored = _pixels(image)
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise InvalidInputError("it is no whole JPEG or PNG picture") from error
    if aspect is not None and fits_as_stored(pixels.shape[1], pixels.shape[0], turns, aspect):
        return StoredPicture(pixels, colored)
    pixels = pixels[:, ::-1] if mirrored else pixels
    return StoredPicture(np.ascontiguousarray(np.rot90(pixels, turns)), colored)


def fits_as_stored(width: int, height: int, turns: int, aspect: float) -> bool:
    """True where stored pixels have the camera's proportions at least as well as the turned picture has."""
    if turns % 2 == 0:
        return True
    shape = math.log(width / height)
    return abs(shape - math.log(aspect)) <= abs(-shape - math.log(aspect))


def focal_35mm(data: bytes) -> float | None:
    """Focal length [mm] as on 35 mm film, from a picture's EXIF; None where it is missing."""
    from PIL import ExifTags, Image

    try:
        with Image.open(io.BytesIO(data)) as picture:
            focal = picture.getexif().get_ifd(ExifTags.IFD.Exif).get(ExifTags.Base.FocalLengthIn35mmFilm)
            return float(focal) if focal else None
    except (OSError, ValueError, SyntaxError, TypeError, Image.DecompressionBombError):
        return None


def _pixels(image: "Image.Image") -> tuple[np.ndarray, bool]:
    """RGB or RGBA of 8 bits, and whether the file has that itself."""
    if image.mode.startswith(("I", "F")):
        deep = np.asarray(image, np.float32)
        gray = np.clip(deep * (255 / max(65535.0, float(deep.max()))), 0, 255).astype(np.uint8)
        return np.repeat(gray[..., None], 3, axis=2), False
    colored = image.mode in ("RGB", "RGBA", "P", "PA", "CMYK", "YCbCr", "LAB", "HSV", "RGBX", "RGBa")
    return np.asarray(image.convert("RGBA" if image.has_transparency_data else "RGB")), colored
