"""Phone apps with a LiDAR: read exports of Polycam, Record3D and 3D Scanner App.

Poses are T_world_camera in ARKit's world (metres, y up) with OpenGL axes. ARKit gives each depth a low, medium or high
confidence; apps write 0, 1, 2 or 0, 127, 255. Low is "quite unreliable" (Polycam), and a depth that is too large marks
a wall as free space: such depths are left out, and so are those beyond the sensor's range, where depth is a guess.

Polycam's raw export ("keyframes"). keyframes/cameras/STEM.json has fx, fy, cx, cy, width, height [pixels] and t_00 to
t_23, the upper rows of T_world_camera; keyframes/images/STEM.jpg is the photograph, keyframes/depth/STEM.png its depth
[mm], keyframes/confidence/STEM.png its confidence: 0, 127 or 255. Where the app has refined the poses,
corrected_cameras and corrected_images are beside these and are used; there are no corrected depths, but those of the
distorted lens are within a pixel of theirs, which are large.

Record3D's .r3d files, which are zip archives, unpacked or not, and its exports of RGB and depth pictures. `metadata` (a
JSON file) has w and h [pixels], K, the 3 x 3 intrinsics column by column, or for each frame perFrameIntrinsicCoeffs
(fx, fy, cx, cy), and poses: qx, qy, qz, qw, tx, ty, tz. Photograph i is rgbd/i.jpg in a .r3d, rgb/i.jpg or .png in an
export; its depth is rgbd/i.depth, float32 [m], dw x dh of them, row by row, with rgbd/i.conf, their confidence (bytes
0, 1 or 2), both compressed by LZFSE; or depth/i.exr [m].

3D Scanner App's export of all data: frame_00000.json beside frame_00000.jpg. The JSON has cameraPoseARFrame,
T_world_camera row by row (16 numbers), and intrinsics, a 3 x 3 matrix row by row, in pixels of the photograph as it is
stored. Its depth is depth_00000.png [mm] or frame_00000.exr [m]; conf_00000.png is the confidence: 0, 1 or 2. Most
frames have depth alone and no photograph: those are skipped.
"""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, ClassVar

import numpy as np
import torch
from msgspec import Meta, Struct

from nerfnav.formats import KeyReport, NamedFiles, Number, Pixels, Positive, list_folder
from nerfnav.geometry import so3
from nerfnav.importers.captures.views import (
    CaptureError,
    DepthFile,
    Lens,
    View,
    Views,
    read_description,
    rigid_pose,
)

_RANGE = 5.0
"""Range of the LiDAR [m]."""
_NO_TIME = "captures are learned without times"


def _lidar_depth(path: Path, confidence: Path | None, unit: float = 0.001) -> DepthFile | None:
    """The depth map at `path` in a unit of `unit` [m], with its confidence where there is such a file; None without."""
    if not path.is_file():
        return None
    return DepthFile(path, unit, confidence if confidence is not None and confidence.is_file() else None, _RANGE)


_PAIRS = (("corrected_cameras", "corrected_images"), ("cameras", "images"))


def find_polycam(folder: Path) -> tuple[Path, Path] | None:
    """The folders of cameras and of photographs in such an export, or in its keyframes; None in another folder."""
    for root in (folder / "keyframes", folder):
        for cameras, images in _PAIRS:
            if (root / images).is_dir() and list_folder(root / cameras, "*.json"):
                return root / cameras, root / images
    return None


class PolycamCamera(Struct):
    """Camera file of Polycam, one for each photograph."""

    IGNORED: ClassVar[dict[str, str]] = {
        "blur_score": "blurred pictures are used as the others are",
        "timestamp": _NO_TIME,
        "center_depth": "the depth map has it",
        "neighbors": "pairs of photographs are found from the poses",
        "manual_keyframe": "all keyframes are used",
    }

    t_00: Number
    t_01: Number
    t_02: Number
    t_03: Number
    t_10: Number
    t_11: Number
    t_12: Number
    t_13: Number
    t_20: Number
    t_21: Number
    t_22: Number
    t_23: Number
    width: Pixels
    height: Pixels
    fx: Positive
    fy: Positive
    cx: Number
    cy: Number


def read_polycam(folders: tuple[Path, Path]) -> Views:
    """Read an export of Polycam. Raises CaptureError where it is cut off or unusable."""
    cameras, images = folders
    files, keys, views = NamedFiles(images), KeyReport(), []
    for file in list_folder(cameras, "*.json"):
        camera, own = read_description(file, PolycamCamera)
        keys = keys.merge(own)
        views.append(_polycam_view(file, camera, files, images))
    return Views("Polycam", tuple(views), keys=keys)


def _polycam_view(file: Path, camera: PolycamCamera, files: NamedFiles, images: Path) -> View:
    rows = [[getattr(camera, f"t_{row}{column}") for column in range(4)] for row in range(3)]
    lens = Lens.measured(str(file), (camera.width, camera.height), (camera.fx, camera.fy), (camera.cx, camera.cy))
    depth, confidence = (images.parent / part / f"{file.stem}.png" for part in ("depth", "confidence"))
    pose = rigid_pose(rows, file.name)
    return View(file.stem, files.find(file.stem), lens, pose, depth=_lidar_depth(depth, confidence))


_METADATA = ("metadata", "metadata.json")
_PICTURES = ("rgbd", "rgb")
_ROOTS = (".", "EXR_RGBD")


def find_record3d(folder: Path) -> tuple[Path, Path] | None:
    """The metadata and the folder of photographs of an unpacked .r3d or an export; None in another folder."""
    for root in _ROOTS:
        for name in _METADATA:
            for pictures in _PICTURES:
                if (folder / root / name).is_file() and (folder / root / pictures).is_dir():
                    return folder / root / name, folder / root / pictures
    return None


class Record3dMetadata(Struct):
    """Metadata of a recording of Record3D, for all of its frames."""

    IGNORED: ClassVar[dict[str, str]] = {
        "fps": _NO_TIME,
        "frameTimestamps": _NO_TIME,
        "cameraType": "the files beside the pictures tell whether there is depth",
        "initPose": "poses holds the pose of each frame",
    }

    w: Pixels
    h: Pixels
    poses: Annotated[list[Annotated[list[Number], Meta(min_length=7, max_length=7)]], Meta(min_length=1)]
    K: Annotated[list[Number], Meta(min_length=9, max_length=9)] | None = None
    perFrameIntrinsicCoeffs: list[Annotated[list[Number], Meta(min_length=4, max_length=4)]] = []
    dw: Pixels | None = None
    dh: Pixels | None = None


def read_record3d(parts: tuple[Path, Path]) -> Views:
    """Read a recording of Record3D. Raises CaptureError where it is cut off or unusable."""
    metadata, pictures = parts
    content, keys = read_description(metadata, Record3dMetadata)
    files = NamedFiles(pictures)
    views = tuple(_record3d_view(index, content, metadata, files) for index in range(len(content.poses)))
    return Views("Record3D", views, keys=keys)


def _record3d_view(index: int, content: Record3dMetadata, metadata: Path, files: NamedFiles) -> View:
    where = f"frame {index} of {metadata}"
    numbers = np.array(content.poses[index])
    if np.linalg.norm(numbers[:4]) < 1e-6:
        raise CaptureError(f"{where} has no pose: its quaternion is zero")
    x, y, z, w = numbers[:4]
    rotation = so3.matrix_from_quaternion(torch.tensor([w, x, y, z], dtype=torch.float64)).numpy()
    path = files.find(str(index))
    path = path if path.suffix else path.with_suffix(".jpg")
    pose, depth = rigid_pose(np.c_[rotation, numbers[4:]], where), _record3d_depth(index, content, path.parent)
    return View(path.name, path, _record3d_lens(index, content, where), pose, depth=depth)


def _record3d_depth(index: int, content: Record3dMetadata, pictures: Path) -> DepthFile | None:
    """The depth map of a frame, if it has one."""
    packed = _lidar_depth(pictures / f"{index}.depth", pictures / f"{index}.conf", 1.0)
    if packed is None:
        return _lidar_depth(pictures.parent / "depth" / f"{index}.exr", None, 1.0)
    if content.dw is None or content.dh is None:
        return packed
    return replace(packed, size=(int(content.dw), int(content.dh)))


def _record3d_lens(index: int, content: Record3dMetadata, where: str) -> Lens:
    """Intrinsics of a frame where it has its own, else those of all."""
    if index < len(content.perFrameIntrinsicCoeffs):
        fx, fy, cx, cy = content.perFrameIntrinsicCoeffs[index]
    elif content.K is not None:
        fx, _, _, _, fy, _, cx, cy, _ = content.K
    else:
        raise CaptureError(f"{where} has no intrinsics: K, or its own of perFrameIntrinsicCoeffs, is needed")
    return Lens.measured(where, (content.w, content.h), (fx, fy), (cx, cy))


class ScannerFrame(Struct):
    """Camera file of 3D Scanner App, one for each frame."""

    IGNORED: ClassVar[dict[str, str]] = {
        "time": _NO_TIME,
        "frame_index": "the name of the file has it",
        "projectionMatrix": "intrinsics holds the lens",
        "mvp": "intrinsics and cameraPoseARFrame hold it",
        "motionQuality": "blurred pictures are used as the others are",
        "averageAngularVelocity": "blurred pictures are used as the others are",
        "averageVelocity": "blurred pictures are used as the others are",
        "exposureDuration": "exposure is found in training",
    }

    cameraPoseARFrame: Annotated[list[Number], Meta(min_length=16, max_length=16)]
    intrinsics: Annotated[list[Number], Meta(min_length=9, max_length=9)]


def find_scanner(folder: Path) -> list[Path]:
    """The frames of such an export; none in a folder without photographs of them."""
    return list_folder(folder, "frame_*.json") if list_folder(folder, "frame_*.jpg") else []


def read_scanner(frames: list[Path]) -> Views:
    """Read an export of 3D Scanner App. Raises CaptureError where it is unusable."""
    keys, views = KeyReport(), []
    for file in frames:
        if (photograph := file.with_suffix(".jpg")).is_file():
            frame, own = read_description(file, ScannerFrame)
            keys = keys.merge(own)
            views.append(_scanner_view(file, frame, photograph))
    if not views:
        raise CaptureError(f"{frames[0].parent} has frames of 3D Scanner App, but none of them has a photograph")
    return Views("3D Scanner App", tuple(views), keys=keys)


def _scanner_view(file: Path, frame: ScannerFrame, photograph: Path) -> View:
    fx, _, cx, _, fy, cy, *_ = frame.intrinsics
    lens = Lens.measured(str(file), _picture_size(photograph, (2 * cx, 2 * cy)), (fx, fy), (cx, cy))
    number = file.stem.removeprefix("frame_")
    depth, confidence = (file.with_name(f"{part}_{number}.png") for part in ("depth", "conf"))
    map_file = _lidar_depth(depth, confidence) or _lidar_depth(file.with_suffix(".exr"), confidence, 1.0)
    rows = [frame.cameraPoseARFrame[row : row + 4] for row in (0, 4, 8)]
    return View(photograph.name, photograph, lens, rigid_pose(rows, file.name), depth=map_file)


def _picture_size(photograph: Path, otherwise: tuple[float, float]) -> tuple[float, float]:
    """Width and height of a photograph [pixels]; `otherwise` for one that cannot be read, which is refused later."""
    from PIL import Image  # slow to import: not before the page is shown

    try:
        with Image.open(photograph) as image:
            return float(image.width), float(image.height)
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError):
        return otherwise
