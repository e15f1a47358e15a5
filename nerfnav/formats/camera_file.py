"""Camera files: read the camera of any format, and write nerfstudio's.

    ROS, OpenCV, Kalibr, EuRoC     see nerfnav/formats/calibration.py
    transforms.json                see nerfnav/formats/transforms.py; with frames, the lens that all of them have
    COLMAP's cameras.txt or .bin   of the cameras that the images beside it use, if there are any

Of a file with several cameras, one is named behind a colon: camchain.yaml:cam1, cameras.txt:2.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TypeVar

from nerfnav.core.errors import InvalidInputError
from nerfnav.formats.calibration import list_cameras, make_camera, parse_camera, read_entries
from nerfnav.formats.colmap import ColmapCamera, ColmapModel, read_cameras
from nerfnav.formats.record import convert_record
from nerfnav.formats.transforms import Transforms, common_lens
from nerfnav.geometry import Camera

T = TypeVar("T")

_TRANSFORMS = {"fl_x", "fl_y", "camera_angle_x", "x_fov", "frames"}
"""Keys of which a transforms.json has at least one."""


def read_camera(path: Path) -> Camera:
    """Read the camera of a file. Raises InvalidInputError for a file without or with several, and for another lens."""
    path, name = _split_name(path)
    if not path.is_file():
        raise InvalidInputError(f"there is no calibration {path}")
    what = f"{path} is no calibration of a camera"
    if path.name in ("cameras.txt", "cameras.bin"):
        return _camera_of_colmap(_choose(_colmap_cameras(path), name, path), what)
    documents = read_entries(path)
    if _TRANSFORMS.isdisjoint(documents[0]):
        return parse_camera(_choose(list_cameras(documents), name, path), what)
    camera = camera_of_transforms(convert_record(documents[0], Transforms, what), path)
    if camera is None:
        raise InvalidInputError(f"{what}: it has frames of different lenses: leave those of one camera")
    return camera


def format_camera(camera: Camera) -> str:
    """Format a camera as a calibration file (.json) that `read_camera` reads."""
    names = ("k1", "k2", "k3", "k4") if camera.fisheye else ("k1", "k2", "p1", "p2", "k3")
    entries = {
        "w": camera.width, "h": camera.height, "fl_x": camera.fx, "fl_y": camera.fy, "cx": camera.cx, "cy": camera.cy,
        "camera_model": "OPENCV_FISHEYE" if camera.fisheye else "OPENCV",
        **dict(zip(names, camera.distortion, strict=False)),
    }  # fmt: skip
    return json.dumps(entries, indent=2) + "\n"


def _split_name(path: Path) -> tuple[Path, str | None]:
    """A path and the name behind its last colon, where the path as a whole is no file."""
    file, colon, name = path.name.rpartition(":")
    return (path.with_name(file), name) if colon and file and not path.is_file() else (path, None)


def _choose(cameras: Mapping[str, T], name: str | None, path: Path) -> T:
    """Choose the camera of that name, or the only one. Raises InvalidInputError, which lists the names."""
    listed = ", ".join(cameras)
    if name is not None and name not in cameras:
        raise InvalidInputError(f"{path} has no camera {name}; it has {listed or 'none'}")
    if name is None and len(cameras) != 1:
        example = f": choose one of {listed}, as in {path.name}:{next(iter(cameras))}" if cameras else ""
        raise InvalidInputError(f"{path} has {len(cameras)} cameras{example}")
    return cameras[name] if name is not None else next(iter(cameras.values()))


def _colmap_cameras(path: Path) -> dict[str, ColmapCamera]:
    """Cameras by their numbers: those that images beside the file use; the first, where all are equal."""
    cameras = {camera.number: camera for camera in read_cameras(path)}
    model = ColmapModel(path.parent)
    if model.missing() is None:
        used = {image.camera for image in model.images()}
        cameras = {number: camera for number, camera in cameras.items() if number in used} or cameras
    if len({(camera.size, camera.model, camera.numbers) for camera in cameras.values()}) == 1:
        cameras = dict([next(iter(cameras.items()))])
    return {str(number): camera for number, camera in cameras.items()}


def _camera_of_colmap(camera: ColmapCamera, what: str) -> Camera:
    camera.require_known()
    model = "fisheye" if camera.fisheye else ""
    try:
        return make_camera(camera.size, (*camera.focal, *camera.center), model, camera.distortion)
    except InvalidInputError as error:
        raise InvalidInputError(f"{what}: {error}") from error


def camera_of_transforms(record: Transforms, path: Path) -> Camera | None:
    """The camera of all frames of a transforms.json; None where they have different ones.

    Raises InvalidInputError for a lens that no camera has here, or without the size of the pictures.
    """
    lens = common_lens(record, path)
    if lens is None:
        return None
    numbers = (lens.fx, lens.fx if lens.fy is None else lens.fy, lens.cx, lens.cy)
    try:
        return make_camera(lens.size or (None, None), numbers, "fisheye" if lens.fisheye else "", lens.distortion)
    except InvalidInputError as error:
        raise InvalidInputError(f"{path} is no calibration of a camera: {error}") from error
