"""Photographs as pixels: read, made smaller, undistorted, and all resample_picture to one pinhole camera.

One camera for all keeps everything behind it simple. It sees what every photograph shows: the borders that only some
of them show, or that undistortion leaves empty, are cut off. Of a fisheye it sees 120 degrees at most, for a pinhole
draws what lies beyond ever larger.
"""

import math
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry import Camera, fisheye_points
from nerfnav.importers.captures.masks import shrink_mask
from nerfnav.importers.captures.views import CaptureError, Lens
from nerfnav.importers.core.stored_picture import read_picture

_LEAST_PIXELS = 8
"""Along each side of what all photographs show."""
_BORDER_POINTS = 33
"""Points along each border of a distorted picture that are followed."""
_ROUND_TRIP = 0.5
"""Largest round-trip error of undistorting and distorting a point [pixels]."""
_ROUNDS = 200
"""Steps in which a distortion is undone."""
_WIDEST = math.tan(math.radians(60))
"""Half of what is kept of a fisheye's picture, on the plane at depth 1."""
_SHRINKING = np.linspace(1, 0.01, 397)
"""Shares of it that are tried, the largest first, until what they leave lies in the picture."""


@dataclass(frozen=True, eq=False)
class Picture:
    """One photograph in memory."""

    pixels: np.ndarray
    """Colours (height, width, 3) or colours and opacity (height, width, 4), 0 to 255, RGB."""
    camera: Camera
    """Its intrinsics; a distortion is left out, but for a fisheye's."""
    distortion: tuple[float, ...]
    """OpenCV's coefficients; none: a pinhole, or a fisheye."""
    mask: np.ndarray | None = None
    """True for pixels that count (height, width); None: all."""


@dataclass(frozen=True)
class _Window:
    """Window on the plane at depth 1 that a picture shows, x to the right and y down."""

    left: float
    right: float
    top: float
    bottom: float


def read_pixels(path: Path, lens: Lens | None = None) -> np.ndarray | None:
    """The photograph that a lens took (height, width, 3 or 4), RGB, 0 to 255; None where the file is no whole image."""
    try:
        return read_picture(path.read_bytes(), None if lens is None else lens.aspect).pixels
    except (OSError, InvalidInputError):
        return None


def shrink_picture(pixels: np.ndarray, lens: Lens, downscale: int, mask: np.ndarray | None = None) -> Picture:
    """A photograph `downscale` times smaller along each side, each pixel the mean of those that it stands for.

    `mask` (height, width) is true for those that count.
    """
    height, width = pixels.shape[:2]
    lens.camera(width, height)  # refuses a shape that is not the lens's
    size = max(1, round(width / downscale)), max(1, round(height / downscale))
    if size != (width, height):
        pixels = cv2.resize(pixels, size, interpolation=cv2.INTER_AREA)
    # the shape was judged at full size, where rounding is small
    distortion = () if lens.fisheye else lens.distortion
    mask = None if mask is None else shrink_mask(mask, *size)
    return Picture(pixels, replace(lens, aspect=None).camera(*size), distortion, mask)


def common_camera(pictures: list[Picture]) -> Camera:
    """The pinhole camera of everything that all pictures show, with their median focal lengths.

    Raises CaptureError where there is no such thing.
    """
    lenses = {(picture.camera, picture.distortion) for picture in pictures}
    windows = [_window(camera, distortion) for camera, distortion in lenses]
    left, right = max(window.left for window in windows), min(window.right for window in windows)
    top, bottom = max(window.top for window in windows), min(window.bottom for window in windows)
    fx = float(np.median([picture.camera.fx for picture in pictures]))
    fy = float(np.median([picture.camera.fy for picture in pictures]))
    width, height = int((right - left) * fx + 1e-6), int((bottom - top) * fy + 1e-6)
    if min(width, height) < _LEAST_PIXELS:
        raise CaptureError("the photographs are too small, or their lenses too different, to have a view in common")
    return Camera(width, height, fx, fy, -left * fx, -top * fy)


def resample_picture(picture: Picture, camera: Camera) -> np.ndarray:
    """Resample a picture to `camera`: (height, width, 3 or 4)."""
    return _resample(picture, picture.pixels, camera)


def resample_mask(picture: Picture, camera: Camera) -> np.ndarray | None:
    """Resample the mask of a picture to `camera`: pixels count where all that they are made of do; None without one."""
    if picture.mask is None:
        return None
    return _resample(picture, np.where(picture.mask, np.uint8(255), np.uint8(0)), camera) == 255


def _resample(picture: Picture, pixels: np.ndarray, camera: Camera) -> np.ndarray:
    straight = not picture.distortion and not picture.camera.fisheye
    if straight and np.allclose(picture.camera.numbers, camera.numbers, rtol=0, atol=1e-6):
        return pixels
    maps = undistortion(picture.camera, picture.distortion, camera)
    return cv2.remap(pixels, *maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)


def undistortion(seen: Camera, distortion: tuple[float, ...], camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Undistortion maps for cv2.remap: pixels of a pinhole `camera` in pictures of camera `seen` with a distortion."""
    straightened = cv2.fisheye.initUndistortRectifyMap if seen.fisheye else cv2.initUndistortRectifyMap
    coefficients = np.array((seen.distortion if seen.fisheye else distortion) or (0.0, 0.0, 0.0, 0.0))
    size = camera.width, camera.height
    return straightened(_matrix(seen), coefficients, np.eye(3), _matrix(camera), size, cv2.CV_32FC1)


def over_white(pixels: np.ndarray) -> np.ndarray:
    """Composite colours (height, width, 3) over white."""
    if pixels.shape[2] == 3:
        return pixels
    opacity = pixels[..., 3:].astype(np.float32) / 255
    return (pixels[..., :3] * opacity + 255 * (1 - opacity)).round().astype(np.uint8)


def _window(camera: Camera, distortion: tuple[float, ...]) -> _Window:
    """The largest window without an empty corner."""
    if camera.fisheye:
        return _fisheye_window(camera)
    along_u, along_v = np.linspace(0, camera.width, _BORDER_POINTS), np.linspace(0, camera.height, _BORDER_POINTS)
    if not distortion:
        left, top = -camera.cx / camera.fx, -camera.cy / camera.fy
        return _Window(left, left + camera.width / camera.fx, top, top + camera.height / camera.fy)
    borders = [
        np.stack(np.broadcast_arrays(u, v), -1)
        for u, v in ((0.0, along_v), (float(camera.width), along_v), (along_u, 0.0), (along_u, float(camera.height)))
    ]
    left, right, top, bottom = (_straightened(border, camera, distortion) for border in borders)
    return _Window(*map(float, (left[:, 0].max(), right[:, 0].min(), top[:, 1].max(), bottom[:, 1].min())))


def _fisheye_window(camera: Camera) -> _Window:
    """Window of a fisheye up to 60 degrees along each axis, shrunk until its corners are in the picture."""
    left, right, top, bottom = (_reach(camera, *way) for way in ((-1, 0), (1, 0), (0, -1), (0, 1)))
    along_x, along_y = np.linspace(-left, right, _BORDER_POINTS), np.linspace(-top, bottom, _BORDER_POINTS)
    sides = ((-left, along_y), (right, along_y), (along_x, -top), (along_x, bottom))
    border = np.concatenate([np.stack(np.broadcast_arrays(*side), -1) for side in sides])
    fits = next((share for share in _SHRINKING if _inside(camera, share * border).all()), 0.0)
    if fits * min(left + right, top + bottom) == 0:
        raise CaptureError("a fisheye's picture shows nothing around its principal point: check its calibration")
    return _Window(-fits * left, fits * right, -fits * top, fits * bottom)


def _reach(camera: Camera, x: float, y: float) -> float:
    """Extent of a fisheye's picture from its principal point along (x, y), on the plane at depth 1."""
    lengths = _WIDEST * _SHRINKING
    return float(lengths[_inside(camera, np.outer(lengths, (x, y)))].max(initial=0.0))


def _inside(camera: Camera, flat: np.ndarray) -> np.ndarray:
    """Mask of the points (n, 2) on the plane at depth 1 that a fisheye shows."""
    shown = fisheye_points(torch.from_numpy(flat), camera.distortion).numpy()
    at = shown * (camera.fx, camera.fy) + (camera.cx, camera.cy)
    inside: np.ndarray = (at >= 0) & (at <= (camera.width, camera.height))  # NaN is not
    return np.logical_and.reduce(inside, axis=1)


def _straightened(points: np.ndarray, camera: Camera, distortion: tuple[float, ...]) -> np.ndarray:
    """Points (n, 2) on the plane at depth 1 that a lens shows at pixels (n, 2), pixel corners at whole numbers."""
    matrix = _matrix(camera)
    matrix[:2, 2] += 0.5
    focal, coefficients, still = np.array([camera.fx, camera.fy]), np.array(distortion), np.zeros(3)
    flat = (points - matrix[:2, 2]) / focal
    missed = np.full_like(flat, np.inf)
    for _ in range(_ROUNDS):  # a fixed point of: move by as much as the distortion still misses
        seen = cv2.projectPoints(np.c_[flat, np.ones(len(flat))], still, still, matrix, coefficients)[0][:, 0]
        missed = seen - points
        flat = flat - missed / focal
    if not np.abs(missed).max() < _ROUND_TRIP:  # nor is NaN
        raise CaptureError(f"the lens distortion {distortion} cannot be undone up to the picture's border")
    return flat


def _matrix(camera: Camera) -> np.ndarray:
    """OpenCV's intrinsics: its pixel centres are at whole numbers."""
    return np.array([[camera.fx, 0.0, camera.cx - 0.5], [0.0, camera.fy, camera.cy - 0.5], [0.0, 0.0, 1.0]])
