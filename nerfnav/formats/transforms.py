"""transforms.json: one typed record for the dialects of nerfstudio, instant-ngp and Blender.

Cameras are OpenGL. Intrinsics stand in the head of the file, or in a frame, where they hold for it alone. A lens is
given in pixels (fl_x, fl_y, cx, cy with w and h), or by its opening angle (camera_angle_x [rad], x_fov [degrees]).

Depth is along the optical axis: nerfstudio's depth_file_path in units of depth_unit_scale_factor (0.001), instant-ngp's
depth_path in units of integer_depth_scale. A mask_path is nerfstudio's: pixels that are 0 do not count.
"""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
from msgspec import Meta, Struct

from nerfnav.core.errors import InvalidInputError
from nerfnav.formats.record import FileName, KeyReport, Number, Pixels, Positive, printable, read_record
from nerfnav.formats.stamps import stamps_in_second

BROWN = ("OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "RADIAL", "SIMPLE_RADIAL", "FULL_OPENCV", "PERSPECTIVE")
"""Values of camera_model for the lens of Brown, with or without distortion."""
FISHEYES = (
    "OPENCV_FISHEYE", "KANNALA_BRANDT", "EQUIDISTANT", "FISHEYE", "SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE",
)  # fmt: skip
"""Those of the lens of Kannala and Brandt."""
_BOX = "the box of the field is found from the cameras and what they show; --box sets it"
_FRAME = "it places the data in a unit cube, and nerfnav works in the world of the poses"
_LOOKS = "it changes how pictures look, and nerfnav learns them as they are"

Row = Annotated[list[Number], Meta(min_length=4, max_length=4)]
Matrix = Annotated[list[Row], Meta(min_length=3, max_length=4)]
Angle = Annotated[float, Meta(ge=0.001, le=3.141)]
"""Opening angle [rad]."""
Degrees = Annotated[float, Meta(ge=0.05, le=179.9)]
"""Opening angle [degrees]."""
Stamp = Annotated[float, Meta(gt=-1e20, lt=1e20)]
"""Time [s], or a count of nanoseconds since 1970."""


class Intrinsics(Struct, kw_only=True):
    """Keys that stand in the head of the file or in a frame."""

    w: Pixels | None = None
    h: Pixels | None = None
    fl_x: Positive | None = None
    fl_y: Positive | None = None
    cx: Number | None = None
    cy: Number | None = None
    camera_angle_x: Angle | None = None
    camera_angle_y: Angle | None = None
    x_fov: Degrees | None = None
    y_fov: Degrees | None = None
    k1: Number | None = None
    k2: Number | None = None
    k3: Number | None = None
    k4: Number | None = None
    k5: Number | None = None
    k6: Number | None = None
    p1: Number | None = None
    p2: Number | None = None
    camera_model: str | None = None
    is_fisheye: bool | None = None
    ftheta_p0: Any = None
    latlong: Any = None
    equirectangular: Any = None
    depth_unit_scale_factor: Positive | None = None


class Frame(Intrinsics, kw_only=True):
    """Photograph of a transforms.json, with its pose and what belongs to it."""

    IGNORED: ClassVar[dict[str, str]] = {
        "sharpness": "blurred pictures are used as the others are",
        "colmap_im_id": "points are matched to pictures by their names",
        "rotation": "the pose in transform_matrix holds it",
        "transform_matrix_start": "a pose is that of the middle of the exposure",
        "transform_matrix_end": "a pose is that of the middle of the exposure",
        "rolling_shutter": "pictures count as taken at once",
        "motion_blur": "pictures count as taken at once",
        "camera_id": "the intrinsics themselves tell the lens",
        "time": "the place counts as still",
    }

    file_path: FileName
    transform_matrix: Matrix | None = None
    depth_file_path: FileName | None = None
    depth_path: FileName | None = None
    mask_path: FileName | None = None
    time_s: Stamp | None = None
    timestamp: Stamp | None = None


class Transforms(Intrinsics, kw_only=True):
    """Content of a transforms.json: the head, and the frames in it."""

    IGNORED: ClassVar[dict[str, str]] = {
        "aabb_scale": _BOX, "render_aabb": _BOX, "aabb": _BOX, "scene_box": _BOX,
        "scale": _FRAME, "offset": _FRAME, "from_na": _FRAME, "orientation_override": _FRAME,
        "auto_scale_poses_override": _FRAME,
        "up": "the direction that is up is found from the poses; --up sets it",
        "sharpen": _LOOKS, "white_transparent": _LOOKS, "black_transparent": _LOOKS, "fix_premult": _LOOKS,
        "is_hdr": _LOOKS, "envmap": _LOOKS,
        "ply_file_path": "points are read from the COLMAP model beside the file",
        "sharpness_discard_threshold": "blurred pictures are used as the others are",
        "rolling_shutter": "pictures count as taken at once",
        "n_frames": "all frames are read",
        "n_extra_learnable_dims": "it configures the network of instant-ngp",
        "importance_sampling": "it configures the training of instant-ngp",
        "enable_ray_loading": "rays come from the lens and the poses",
        "normal_mts_args": "it configures the renderer that made the pictures",
    }  # fmt: skip

    frames: list[Frame] = []
    applied_transform: Matrix | None = None
    applied_scale: Positive | None = None
    enable_depth_loading: bool = True
    integer_depth_scale: Number | None = None
    train_filenames: list[FileName] | None = None
    val_filenames: list[FileName] | None = None
    test_filenames: list[FileName] | None = None


def read_transforms(path: Path) -> tuple[Transforms, KeyReport]:
    """Read a transforms.json. Raises InvalidInputError, with the key's path, where a value does not fit."""
    record, keys = read_record(path, Transforms)
    if not record.enable_depth_loading:
        keys = keys.ignoring("enable_depth_loading is false", "frames[].depth_path", "integer_depth_scale")
    elif depth_unit(record) is None:
        keys = keys.ignoring("there is no integer_depth_scale above 0", "frames[].depth_path")
    return record, keys


def depth_unit(record: Transforms) -> float | None:
    """Length of a stored 1 in the maps of depth_path, in the capture's units; None where they are not to be read."""
    scale = record.depth_unit_scale_factor if record.integer_depth_scale is None else record.integer_depth_scale
    return scale if record.enable_depth_loading and scale is not None and scale > 0 else None


def undo_applied(record: Transforms, path: Path) -> np.ndarray | None:
    """Similarity (4, 4) from the poses of a file back to the world of its capture; None where nothing was applied.

    nerfstudio has moved positions by applied_transform, and then multiplied them by applied_scale. Raises
    InvalidInputError for a transform that cannot be undone.
    """
    if record.applied_transform is None and record.applied_scale is None:
        return None
    applied = np.eye(4)
    if record.applied_transform is not None:
        applied[:3] = np.array(record.applied_transform)[:3]
    if np.linalg.det(applied[:3, :3]) <= 1e-12:
        raise InvalidInputError(f"applied_transform of {path} is no transform: it must be 3 x 4 numbers, not singular")
    return np.linalg.inv(applied) @ np.diag([*3 * [1 / (record.applied_scale or 1.0)], 1.0])


@dataclass(frozen=True)
class FileLens:
    """Lens of a frame, as the file gives it."""

    size: tuple[float, float] | None
    """Width and height [pixels]; None where the file gives an angle alone: lengths are then in widths and heights."""
    fx: float
    """Focal length along u [pixels, or widths]."""
    fy: float | None
    """Focal length along v [pixels, or heights]; None: the pixels are square."""
    cx: float
    """Principal point along u [pixels, or widths]."""
    cy: float
    """Principal point along v [pixels, or heights]."""
    distortion: tuple[float, ...]
    """k1, k2, p1, p2, k3, k4, k5, k6; of a fisheye, k1, k2, k3, k4."""
    fisheye: bool
    """Model of Kannala and Brandt, see geometry/lens.py."""


def lens_of(record: Transforms, frame: Frame | None, where: str) -> FileLens:
    """The lens of a frame, or of the head of the file; `where` names it. Raises InvalidInputError without one."""

    def entry(key: str) -> Any:
        own = None if frame is None else getattr(frame, key)
        return getattr(record, key) if own is None else own

    fisheye = _is_fisheye(entry, where)
    names = ("k1", "k2", "k3", "k4") if fisheye else ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
    distortion = tuple(entry(name) or 0.0 for name in names)
    width, height = entry("w"), entry("h")
    size = None if width is None or height is None else (width, height)
    fx, fy = (_focal(entry, axis, extent) for axis, extent in zip("xy", size or (None, None), strict=True))
    if fx is None and fy is not None and size is not None:
        fx = fy  # of square pixels
    if fx is None or (fisheye and entry("fl_x") is None):
        kind = "is a fisheye's, and has" if fisheye else "has"
        angle = "" if fisheye else ", or camera_angle_x"
        raise InvalidInputError(f"{where} {kind} no intrinsics: fl_x with w and h{angle} is needed")
    if size is None:
        if entry("cx") is not None or entry("cy") is not None:
            raise InvalidInputError(f"{where} has cx or cy in pixels, but no w and h: they are needed, too")
        return FileLens(None, fx, fy, 0.5, 0.5, distortion, fisheye)
    cx, cy = (size[axis] / 2 if entry(key) is None else entry(key) for axis, key in enumerate(("cx", "cy")))
    return FileLens(size, fx, fx if fy is None else fy, cx, cy, distortion, fisheye)


def has_camera(record: Transforms) -> bool:
    """Return True where a file gives the size of its pictures, and a focal length or an angle: a camera."""
    parts = (record, *record.frames[:1])

    def given(*keys: str) -> bool:
        return any(getattr(part, key) is not None for part in parts for key in keys)

    return given("w") and given("h") and given("fl_x", "fl_y", "camera_angle_x", "x_fov")


def common_lens(record: Transforms, path: Path) -> FileLens | None:
    """The lens that all frames have, or that of the head where there are none; None where frames differ."""
    lenses = {lens_of(record, frame, f"{frame.file_path} in {path}") for frame in record.frames}
    if not lenses:
        return lens_of(record, None, str(path))
    return next(iter(lenses)) if len(lenses) == 1 else None


def _is_fisheye(entry: Any, where: str) -> bool:
    other = next((key for key in ("ftheta_p0", "latlong", "equirectangular") if entry(key)), None)
    if other is not None:
        raise InvalidInputError(f"{where} has a lens by {other}, which is not known here: undistort its pictures")
    model = (entry("camera_model") or BROWN[0]).upper()
    if model not in (*BROWN, *FISHEYES):
        known = ", ".join((*BROWN, *FISHEYES))
        raise InvalidInputError(f"{where} has the camera model {printable(model)}; known are: {known}")
    return bool(entry("is_fisheye")) or model in FISHEYES


def _focal(entry: Any, axis: str, extent: float | None) -> float | None:
    """Focal length along an axis, in pixels of an `extent` [pixels], or relative to it where that is unknown."""
    focal, angle, degrees = entry(f"fl_{axis}"), entry(f"camera_angle_{axis}"), entry(f"{axis}_fov")
    if focal is not None and extent is not None:
        return focal
    angle = math.radians(degrees) if angle is None and degrees is not None else angle
    return None if angle is None else 0.5 * (extent or 1.0) / math.tan(angle / 2)


def time_of(frame: Frame) -> float | None:
    """Time of a frame [s], of its time_s, or of a timestamp in s, ms, us or ns; None where it tells none."""
    if frame.time_s is not None or frame.timestamp is None:
        return frame.time_s
    return frame.timestamp / (stamps_in_second(frame.timestamp) or 1.0)
