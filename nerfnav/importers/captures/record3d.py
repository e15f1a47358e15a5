"""Record3D: its .r3d files, which are zip archives, unpacked or not, and its export of RGB and depth pictures.

`metadata` (a JSON file) has w and h [pixels], K, the 3 x 3 intrinsics column by column, or for each frame
perFrameIntrinsicCoeffs (fx, fy, cx, cy), and poses: qx, qy, qz, qw, tx, ty, tz of T_world_camera in ARKit's world
(metres, y up) with OpenGL axes. Photograph i is rgbd/i.jpg in a .r3d, rgb/i.jpg or .png in an export; its depth is
rgbd/i.depth, float32 [m], dw x dh of them, row by row, with rgbd/i.conf, which tells how sure they are (bytes 0, 1 or
2), both compressed by LZFSE; or depth/i.exr [m].
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from nerfnav.geometry import so3
from nerfnav.importers.captures.views import (
    LARGEST,
    CaptureError,
    DepthFile,
    Lens,
    View,
    Views,
    lidar_depth,
    read_json,
    rigid_pose,
)

_METADATA = ("metadata", "metadata.json")
_PICTURES = ("rgbd", "rgb")
_ROOTS = (".", "EXR_RGBD")


def is_record3d(folder: Path) -> bool:
    """Whether a folder is an unpacked .r3d or an export."""
    return _parts(folder) is not None


def read_record3d(folder: Path) -> Views:
    """What a recording says. Raises CaptureError where it is cut off or says nothing that can be used."""
    parts = _parts(folder)
    if parts is None:
        raise CaptureError(f"{folder} has no metadata of Record3D with pictures in rgbd/ or rgb/")
    metadata, pictures = parts
    said = read_json(metadata)
    poses, size = said.get("poses"), (said.get("w"), said.get("h"))
    if not isinstance(poses, list) or not poses or not all(isinstance(number, int | float) for number in size):
        raise CaptureError(f"{metadata} is no metadata of Record3D: it lacks poses, w or h")
    views = tuple(_view(index, pose, said, metadata, pictures) for index, pose in enumerate(poses))
    return Views("Record3D", views)


def _parts(folder: Path) -> tuple[Path, Path] | None:
    """The metadata and the folder of photographs."""
    for root in _ROOTS:
        for name in _METADATA:
            for pictures in _PICTURES:
                if (folder / root / name).is_file() and (folder / root / pictures).is_dir():
                    return folder / root / name, folder / root / pictures
    return None


def _view(index: int, pose: Any, said: dict[str, Any], metadata: Path, pictures: Path) -> View:
    where = f"frame {index} of {metadata}"
    try:
        numbers = np.array(pose, dtype=np.float64)
    except (TypeError, ValueError):
        numbers = np.zeros(0)
    if numbers.shape != (7,) or not (np.abs(numbers) < LARGEST).all() or np.linalg.norm(numbers[:4]) < 1e-6:
        raise CaptureError(f"{where} has no pose of seven finite numbers")
    x, y, z, w = numbers[:4]
    rotation = so3.matrix_from_quaternion(torch.tensor([w, x, y, z], dtype=torch.float64)).numpy()
    names = [pictures / f"{index}{end}" for end in (".jpg", ".png", ".jpeg")]
    path = next((name for name in names if name.is_file()), names[0])
    pose, depth = rigid_pose(np.c_[rotation, numbers[4:]], where), _depth(index, said, pictures)
    return View(path.name, path, _lens(index, said, where), pose, depth=depth)


def _depth(index: int, said: dict[str, Any], pictures: Path) -> DepthFile | None:
    """The depth map of a frame, if it has one."""
    packed = lidar_depth(pictures / f"{index}.depth", pictures / f"{index}.conf", 1.0)
    if packed is None:
        return lidar_depth(pictures.parent / "depth" / f"{index}.exr", None, 1.0)
    width, height = said.get("dw"), said.get("dh")
    told = type(width) is int and type(height) is int and min(width, height) > 0
    return replace(packed, size=(width, height)) if told else packed


def _lens(index: int, said: dict[str, Any], where: str) -> Lens:
    """Intrinsics of a frame where it has its own, else those of all."""
    try:
        own = said.get("perFrameIntrinsicCoeffs")
        if isinstance(own, list) and index < len(own):
            fx, fy, cx, cy = (float(number) for number in own[index])
        else:
            fx, _, _, _, fy, _, cx, cy, _ = (float(number) for number in said["K"])
    except (KeyError, TypeError, ValueError) as error:
        raise CaptureError(f"{where} has no intrinsics of nine numbers in K") from error
    return Lens.measured((float(said["w"]), float(said["h"])), (fx, fy), (cx, cy))
