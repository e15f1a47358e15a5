"""Captures described by JSON: transforms.json of nerfstudio and instant-ngp, and Blender's one file for each split.

Cameras are OpenGL, as here. Intrinsics stand in the file's head, or in a frame, where they hold for it alone.
"""

import math
import os
from pathlib import Path
from typing import Any

import numpy as np

from nerfnav.importers.captures.colmap import read_tracks_beside
from nerfnav.importers.captures.views import (
    LARGEST,
    CaptureError,
    DepthFile,
    Lens,
    View,
    Views,
    array_of,
    read_json,
    rigid_pose,
)

SPLITS = ("train", "val", "test")
"""Blender's files are called transforms_{split}.json."""
_SUFFIXES = ("", ".png", ".jpg", ".jpeg", ".JPG", ".JPEG", ".PNG", ".webp")
_KNOWN_MODELS = ("OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "RADIAL", "SIMPLE_RADIAL", "FULL_OPENCV", "PERSPECTIVE")
_FISHEYES = ("OPENCV_FISHEYE", "KANNALA_BRANDT", "EQUIDISTANT")
_DISTORTION = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")


def find_transforms(folder: Path) -> Path | None:
    """The transforms.json of a folder; None where it has none."""
    path = folder / "transforms.json"
    return path if path.is_file() else None


def find_blender(folder: Path) -> dict[str, Path]:
    """The files in a folder for Blender's splits, by the name of their split."""
    files = {split: folder / f"transforms_{split}.json" for split in SPLITS}
    return {split: file for split, file in files.items() if file.is_file()}


def read_transforms(path: Path) -> Views:
    """Read a transforms.json. Raises CaptureError where it is unusable."""
    views = _views(path)
    return Views("transforms.json", views, read_tracks_beside(path.parent, views))


def read_blender(files: dict[str, Path]) -> Views:
    """Read transforms_{train,val,test}.json; beside a training split the others are held out."""
    views = (
        view
        for split, file in files.items()
        for view in _views(file, test="train" in files and split != "train")
    )
    return Views("Blender", tuple(views))


def read_frames(path: Path) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Parse a transforms.json into its head and frames. Raises CaptureError where it has none."""
    head = read_json(path)
    frames = head.get("frames")
    if not isinstance(frames, list) or not frames or not all(isinstance(frame, dict) for frame in frames):
        raise CaptureError(f"{path} has no list of frames: it is not a transforms.json")
    return head, frames


def _views(path: Path, test: bool = False) -> tuple[View, ...]:
    head, frames = read_frames(path)
    undo = _undone(head.get("applied_transform"), path)
    views = []
    for index, frame in enumerate(frames):
        name = frame.get("file_path")
        if not isinstance(name, str) or not name:
            raise CaptureError(f"frame {index} of {path} has no file_path")
        pose = rigid_pose(frame.get("transform_matrix"), f"{name} in {path}")
        entries, where = {**head, **frame}, f"{name} in {path}"
        depth = _depth(entries, path.parent, where)
        view = View(name, image_path(path.parent, name), _lens(entries, where), pose, test, depth)
        views.append(view if undo is None else view.transformed(undo))
    return tuple(views)


def image_path(folder: Path, name: str) -> Path:
    """Path of a photograph that is named with or without its ending; as named where it does not exist."""
    named = folder / name
    return Path(next((f"{named}{end}" for end in _SUFFIXES if os.path.isfile(f"{named}{end}")), named))


def _depth(entries: dict[str, Any], folder: Path, where: str) -> DepthFile | None:
    """A frame's depth map, if it has one."""
    name, unit = entries.get("depth_file_path"), _number(entries, "depth_unit_scale_factor", where)
    if name is not None and (not isinstance(name, str) or not name):
        raise CaptureError(f"{where} has a depth_file_path that is no name of a file")
    if unit is not None and unit <= 0:
        raise CaptureError(f"{where} has a depth_unit_scale_factor of {unit:g}: it must be above 0")
    return None if name is None else DepthFile(folder / name, 0.001 if unit is None else unit)


def _lens(entries: dict[str, Any], where: str) -> Lens:
    model = str(entries.get("camera_model", "OPENCV")).upper()
    if entries.get("is_fisheye"):
        model = "OPENCV_FISHEYE"
    fisheye = model in _FISHEYES
    if model not in (*_KNOWN_MODELS, *_FISHEYES):
        known = ", ".join((*_KNOWN_MODELS, *_FISHEYES))
        raise CaptureError(f"{where} has the camera model {model}; known are: {known}")
    numbers = {key: _number(entries, key, where) for key in ("w", "h", "fl_x", "fl_y", "cx", "cy", "camera_angle_x")}
    names = ("k1", "k2", "k3", "k4") if fisheye else _DISTORTION
    distortion = tuple(_number(entries, key, where) or 0.0 for key in names)
    width, height, fx = numbers["w"], numbers["h"], numbers["fl_x"]
    if fx is not None and width is not None and height is not None:
        fy, cx, cy = numbers["fl_y"], numbers["cx"], numbers["cy"]
        center = (width / 2 if cx is None else cx, height / 2 if cy is None else cy)
        return Lens.measured((width, height), (fx, fx if fy is None else fy), center, *distortion, fisheye=fisheye)
    if fisheye:
        raise CaptureError(f"{where} is a fisheye's, and has no intrinsics: fl_x with w and h is needed")
    angle = numbers["camera_angle_x"]
    if angle is None:
        raise CaptureError(f"{where} has no intrinsics: fl_x with w and h, or camera_angle_x is needed")
    if not 0 < angle < math.pi:
        raise CaptureError(f"{where} has a camera_angle_x of {angle:g}: it must lie between 0 and pi")
    return Lens(0.5 / math.tan(angle / 2), None, distortion=distortion if any(distortion) else ())


def _number(entries: dict[str, Any], key: str, where: str) -> float | None:
    value = entries.get(key)
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < LARGEST:
        raise CaptureError(f"{key} of {where} is not a finite number")
    return float(value)


def _undone(applied: Any, path: Path) -> np.ndarray | None:
    """Inverse of the applied transform, back to the world of the capture; None where there is none."""
    if applied is None:
        return None
    rows = np.atleast_2d(array_of(applied))[:3]
    if rows.shape != (3, 4) or not np.isfinite(rows).all() or np.linalg.det(rows[:, :3]) <= 1e-12:
        raise CaptureError(f"applied_transform of {path} is no transform: it must be 3 x 4 numbers, not singular")
    return np.linalg.inv(np.vstack([rows, [0.0, 0.0, 0.0, 1.0]]))
