"""Camera calibration files: read those of ROS, OpenCV, nerfstudio and instant-ngp, and COLMAP; write nerfstudio's.

    ROS's camera_info (.yaml)      image_width, camera_matrix.data, distortion_model, distortion_coefficients.data
    OpenCV's FileStorage (.yaml)   image_width, camera_matrix, distortion_coefficients
    transforms.json                w, h, fl_x, fl_y, cx, cy, camera_model, k1, k2, p1, p2, k3, k4
    COLMAP's cameras.txt or .bin   the only camera there

Models: none, Brown's (plumb_bob, OPENCV) and Kannala and Brandt's (equidistant, OPENCV_FISHEYE, KANNALA_BRANDT).
"""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry.camera import Camera
from nerfnav.geometry.colmap_cameras import colmap_cameras

_FISHEYE = ("equidistant", "fisheye", "OPENCV_FISHEYE", "KANNALA_BRANDT", "kannala_brandt")
_BROWN = ("plumb_bob", "rational_polynomial", "OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "RADIAL", "SIMPLE_RADIAL",
          "FULL_OPENCV", "PERSPECTIVE", "")  # fmt: skip
_OPENCV = ("%YAML:1.0", "!!opencv-matrix")
"""Marks of OpenCV's own files, which other readers of YAML reject."""


def read_camera(path: Path) -> Camera:
    """The camera of a calibration file. Raises InvalidInputError for a file without, or of another model."""
    if path.name in ("cameras.txt", "cameras.bin"):
        return _of_colmap(path)
    try:
        text = path.read_text(encoding="utf-8-sig")
    except FileNotFoundError as error:
        raise InvalidInputError(f"there is no calibration {path}") from error
    except (OSError, UnicodeDecodeError) as error:
        raise InvalidInputError(f"{path} cannot be read as a calibration: {error}") from error
    try:
        if any(mark in text for mark in _OPENCV):
            return parse_camera(_stored(text))
        entries = json.loads(text) if path.suffix.lower() == ".json" else yaml.safe_load(text)
        if not isinstance(entries, dict):
            raise InvalidInputError("it holds no names with values")
        return _of_transforms(entries) if "fl_x" in entries else parse_camera(entries)
    except (InvalidInputError, ValueError, TypeError, yaml.YAMLError) as error:
        raise InvalidInputError(f"{path} is no calibration of a camera: {' '.join(str(error).split())}") from error


def format_camera(camera: Camera) -> str:
    """Format a camera as a calibration file (.json) that `read_camera` reads."""
    names = ("k1", "k2", "k3", "k4") if camera.fisheye else ("k1", "k2", "p1", "p2", "k3")
    entries = {
        "w": camera.width, "h": camera.height, "fl_x": camera.fx, "fl_y": camera.fy, "cx": camera.cx, "cy": camera.cy,
        "camera_model": "OPENCV_FISHEYE" if camera.fisheye else "OPENCV",
        **dict(zip(names, camera.distortion, strict=False)),
    }  # fmt: skip
    return json.dumps(entries, indent=2) + "\n"


def _of_colmap(path: Path) -> Camera:
    if not path.is_file():
        raise InvalidInputError(f"there is no calibration {path}")
    cameras = list(colmap_cameras(path))
    lenses = {(camera.size, camera.model, camera.numbers) for camera in cameras}
    if len(lenses) != 1:
        raise InvalidInputError(f"{path} has {len(lenses)} cameras: leave the one that takes the pictures, as text")
    (camera,) = cameras[:1]
    model = "OPENCV_FISHEYE" if camera.fisheye else "OPENCV"
    coefficients = (*camera.distortion, *4 * (0.0,))[: max(4, len(camera.distortion))]
    return _camera(camera.size, (*camera.focal, *camera.center), model, coefficients)


def _stored(text: str) -> dict[str, Any]:
    """Read the camera of an OpenCV FileStorage file, under the names of ROS."""
    import cv2  # slow to import

    try:
        storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
    except cv2.error as error:
        raise InvalidInputError("it cannot be read as a file of OpenCV") from error
    entries: dict[str, Any] = {"distortion_model": storage.getNode("distortion_model").string()}
    for name in ("image_width", "image_height"):
        entries[name] = None if storage.getNode(name).empty() else storage.getNode(name).real()
    for name in ("camera_matrix", "distortion_coefficients"):
        node = storage.getNode(name)
        entries[name] = None if node.empty() else node.mat()
    if entries["distortion_model"] == "" and not storage.getNode("fisheye_model").empty():
        entries["distortion_model"] = "fisheye" if storage.getNode("fisheye_model").real() else ""
    storage.release()
    return entries


def parse_camera(entries: dict[str, Any]) -> Camera:
    """Parse the camera in ROS's or OpenCV's entries. Raises InvalidInputError without one, or for another lens."""
    matrix = _numbers(entries, "camera_matrix")
    if matrix.size != 9:
        raise InvalidInputError(f"camera_matrix has 9 numbers, not {matrix.size}")
    (fx, _, cx), (_, fy, cy), _ = matrix.reshape(3, 3).tolist()
    lens = entries.get("distortion_coefficients")
    coefficients = () if lens is None else tuple(_numbers(entries, "distortion_coefficients").ravel().tolist())
    model = str(entries.get("distortion_model") or "")
    return _camera((entries.get("image_width"), entries.get("image_height")), (fx, fy, cx, cy), model, coefficients)


def _of_transforms(entries: dict[str, Any]) -> Camera:
    focal = float(entries["fl_x"])
    size = entries.get("w"), entries.get("h")
    center = (entries.get("cx", 0.5 * float(size[0] or 0)), entries.get("cy", 0.5 * float(size[1] or 0)))
    model = str(entries.get("camera_model", "OPENCV"))
    names = ("k1", "k2", "k3", "k4") if model in _FISHEYE else ("k1", "k2", "p1", "p2", "k3")
    coefficients = tuple(float(entries.get(name, 0.0)) for name in names)
    numbers = (focal, float(entries.get("fl_y", focal)), float(center[0]), float(center[1]))
    return _camera(size, numbers, model, coefficients)


def _numbers(entries: dict[str, Any], name: str) -> np.ndarray:
    """The matrix of that name: a list, or what has its numbers as `data`."""
    value = entries.get(name)
    value = value.get("data") if isinstance(value, dict) else value
    if value is None:
        raise InvalidInputError(f"{name} is missing")
    return np.asarray(value, dtype=float)


def _camera(
    size: tuple[Any, Any], numbers: tuple[float, float, float, float], model: str, coefficients: tuple[float, ...]
) -> Camera:
    if model not in (*_FISHEYE, *_BROWN):
        known = ", ".join((*_BROWN[:3], *_FISHEYE[:4]))
        raise InvalidInputError(f"the lens model {model!r} is not known here; known are {known}")
    if None in size or not all(float(edge) >= 1 and float(edge) == int(edge) for edge in size):
        raise InvalidInputError("the picture's width and height are missing, or no whole numbers")
    fx, fy, *center = numbers
    if not (fx > 0 and fy > 0 and all(map(math.isfinite, numbers))):
        raise InvalidInputError(f"focal lengths are above 0 pixels, not {fx:g} and {fy:g}")
    if model not in _FISHEYE and any(coefficients[5:]):
        raise InvalidInputError("a lens of more than k1, k2, p1, p2 and k3 is not known here: calibrate with those")
    brown = coefficients[:5] if any(coefficients) else ()
    kept = (*coefficients, 0.0, 0.0, 0.0, 0.0)[:4] if model in _FISHEYE else brown
    return Camera(int(size[0]), int(size[1]), fx, fy, center[0], center[1], kept, model in _FISHEYE)
