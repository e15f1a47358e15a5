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
from typing import Any

import numpy as np
import torch
from PIL import Image

from nerfnav.geometry import so3
from nerfnav.importers.captures.transforms import image_path
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

_RANGE = 5.0
"""Range of the LiDAR [m]."""


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
            if (root / images).is_dir() and next((root / cameras).glob("*.json"), None) is not None:
                return root / cameras, root / images
    return None


def read_polycam(folders: tuple[Path, Path]) -> Views:
    """Read an export of Polycam. Raises CaptureError where it is cut off or unusable."""
    cameras, images = folders
    return Views("Polycam", tuple(_polycam_view(file, images) for file in sorted(cameras.glob("*.json"))))


def _polycam_view(file: Path, images: Path) -> View:
    content = read_json(file)
    try:
        rows = [[float(content[f"t_{row}{column}"]) for column in range(4)] for row in range(3)]
        size = float(content["width"]), float(content["height"])
        lens = Lens.measured(
            size, (float(content["fx"]), float(content["fy"])), (float(content["cx"]), float(content["cy"]))
        )
    except (KeyError, TypeError, ValueError) as error:
        raise CaptureError(f"{file} is not a camera of Polycam: it lacks or garbles {error}") from error
    depth, confidence = (images.parent / part / f"{file.stem}.png" for part in ("depth", "confidence"))
    pose = rigid_pose(rows, file.name)
    return View(file.stem, image_path(images, file.stem), lens, pose, depth=_lidar_depth(depth, confidence))


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


def read_record3d(parts: tuple[Path, Path]) -> Views:
    """Read a recording of Record3D. Raises CaptureError where it is cut off or unusable."""
    metadata, pictures = parts
    content = read_json(metadata)
    poses, size = content.get("poses"), (content.get("w"), content.get("h"))
    if not isinstance(poses, list) or not poses or not all(isinstance(number, int | float) for number in size):
        raise CaptureError(f"{metadata} is no metadata of Record3D: it lacks poses, w or h")
    views = tuple(_record3d_view(index, pose, content, metadata, pictures) for index, pose in enumerate(poses))
    return Views("Record3D", views)


def _record3d_view(index: int, pose: Any, content: dict[str, Any], metadata: Path, pictures: Path) -> View:
    where = f"frame {index} of {metadata}"
    numbers = array_of(pose)
    if numbers.shape != (7,) or not (np.abs(numbers) < LARGEST).all() or np.linalg.norm(numbers[:4]) < 1e-6:
        raise CaptureError(f"{where} has no pose of seven finite numbers")
    x, y, z, w = numbers[:4]
    rotation = so3.matrix_from_quaternion(torch.tensor([w, x, y, z], dtype=torch.float64)).numpy()
    names = [pictures / f"{index}{end}" for end in (".jpg", ".png", ".jpeg")]
    path = next((name for name in names if name.is_file()), names[0])
    pose, depth = rigid_pose(np.c_[rotation, numbers[4:]], where), _record3d_depth(index, content, pictures)
    return View(path.name, path, _record3d_lens(index, content, where), pose, depth=depth)


def _record3d_depth(index: int, content: dict[str, Any], pictures: Path) -> DepthFile | None:
    """The depth map of a frame, if it has one."""
    packed = _lidar_depth(pictures / f"{index}.depth", pictures / f"{index}.conf", 1.0)
    if packed is None:
        return _lidar_depth(pictures.parent / "depth" / f"{index}.exr", None, 1.0)
    width, height = content.get("dw"), content.get("dh")
    known = type(width) is int and type(height) is int and min(width, height) > 0
    return replace(packed, size=(width, height)) if known else packed


def _record3d_lens(index: int, content: dict[str, Any], where: str) -> Lens:
    """Intrinsics of a frame where it has its own, else those of all."""
    try:
        own = content.get("perFrameIntrinsicCoeffs")
        if isinstance(own, list) and index < len(own):
            fx, fy, cx, cy = (float(number) for number in own[index])
        else:
            fx, _, _, _, fy, _, cx, cy, _ = (float(number) for number in content["K"])
    except (KeyError, TypeError, ValueError) as error:
        raise CaptureError(f"{where} has no intrinsics of nine numbers in K") from error
    return Lens.measured((float(content["w"]), float(content["h"])), (fx, fy), (cx, cy))


def find_scanner(folder: Path) -> list[Path]:
    """The frames of such an export; none in a folder without photographs of them."""
    return sorted(folder.glob("frame_*.json")) if next(folder.glob("frame_*.jpg"), None) is not None else []


def read_scanner(frames: list[Path]) -> Views:
    """Read an export of 3D Scanner App. Raises CaptureError where it is unusable."""
    pairs = [(file, file.with_suffix(".jpg")) for file in frames]
    views = tuple(_scanner_view(file, photograph) for file, photograph in pairs if photograph.is_file())
    if not views:
        raise CaptureError(f"{frames[0].parent} has frames of 3D Scanner App, but none of them has a photograph")
    return Views("3D Scanner App", views)


def _scanner_view(file: Path, photograph: Path) -> View:
    content = read_json(file)
    pose, matrix = content.get("cameraPoseARFrame"), content.get("intrinsics")
    if not (isinstance(pose, list) and isinstance(matrix, list) and len(pose) == 16 and len(matrix) == 9):
        raise CaptureError(f"{file} is not a frame of 3D Scanner App: it has no cameraPoseARFrame and intrinsics")
    try:
        fx, _, cx, _, fy, cy, *_ = (float(number) for number in matrix)
    except (TypeError, ValueError) as error:
        raise CaptureError(f"{file} has intrinsics that are no numbers") from error
    lens = Lens.measured(_picture_size(photograph, (2 * cx, 2 * cy)), (fx, fy), (cx, cy))
    number = file.stem.removeprefix("frame_")
    depth, confidence = (file.with_name(f"{part}_{number}.png") for part in ("depth", "conf"))
    map_file = _lidar_depth(depth, confidence) or _lidar_depth(file.with_suffix(".exr"), confidence, 1.0)
    rows = [pose[row : row + 4] for row in (0, 4, 8)]
    return View(photograph.name, photograph, lens, rigid_pose(rows, file.name), depth=map_file)


def _picture_size(photograph: Path, otherwise: tuple[float, float]) -> tuple[float, float]:
    """Width and height of a photograph [pixels]; `otherwise` for one that cannot be read, which is refused later."""
    try:
        with Image.open(photograph) as image:
            return float(image.width), float(image.height)
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError):
        return otherwise
