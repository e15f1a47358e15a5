"""Depth maps of photographs: read, check, and convert to what `PosedImages` holds.

Files are PNG, TIFF, NumPy's .npy, OpenEXR, or Record3D's LZFSE-compressed floats. The reader of the last two is an
extra, `nerfnav[depth]`, because few captures have them.

Files hold the distance along the camera's optical axis, in units of `depth_unit_scale_factor` (nerfstudio: 0.001, so
millimetres) or those of the app that wrote them, 0 where nothing was measured. What is kept is the distance along
each pixel's ray, in metres; what a sensor is unsure of counts as not measured.
"""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.core.extras import import_extra
from nerfnav.geometry import Camera
from nerfnav.importers.captures.pictures import Picture, undistortion
from nerfnav.importers.captures.views import ASPECT, CaptureError, DepthFile, View

_EXTRA = "depth"
_USER = "the depth of this capture (--depth off learns from its pictures alone)"
_LONGEST = 8192
"""Pixels along a side of the largest map that is read."""
_MOST_PACKED = 16 << 20
"""Bytes of the largest compressed map: what it swells to is only known afterwards."""


def stored_map(path: Path, size: tuple[int, int] | None, kind: type) -> np.ndarray | None:
    """Read the stored numbers of a map of depths or confidence; None where it is no whole file of a known kind.

    `size` (width, height) and `kind`, the type of its numbers, are for files without a header. Raises CaptureError for
    a map of another size than its metadata give, and MissingExtraError for a kind that an extra reads.
    """
    try:
        if not path.is_file():
            return None
        if path.suffix in (".depth", ".conf"):
            return _unpacked(path, size, kind)
        if path.suffix.lower() == ".exr":
            return _exr(path)
        if path.suffix.lower() == ".npy":
            return _one_channel(np.load(path, allow_pickle=False))
        return cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    except (OSError, ValueError, EOFError, cv2.error):
        return None


def _one_channel(stored: np.ndarray) -> np.ndarray:
    """The map (h, w) in an array of (h, w, 1) or (1, h, w); others as they are."""
    axes = [axis for axis in (0, -1) if stored.ndim == 3 and stored.shape[axis] == 1]
    return stored.squeeze(axes[0]) if axes else stored


def _unpacked(path: Path, size: tuple[int, int] | None, kind: type) -> np.ndarray | None:
    """Rows of a map of `size` (width, height) that LZFSE has compressed."""
    lzfse: Any = import_extra("lzfse", _EXTRA, _USER)
    if size is None:
        raise CaptureError(f"the size of {path} is not known: its capture's metadata lack dw and dh, in pixels")
    if path.stat().st_size > _MOST_PACKED:
        return None
    try:
        numbers = np.frombuffer(lzfse.decompress(path.read_bytes()), kind)
    except (lzfse.error, MemoryError, ValueError):
        return None
    if len(numbers) != size[0] * size[1]:
        raise CaptureError(
            f"{path} holds {len(numbers)} numbers, not the {size[0]} x {size[1]} of the metadata (dw, dh)"
        )
    return numbers.reshape(size[1], size[0])


def _exr(path: Path) -> np.ndarray | None:
    """The one channel of an OpenEXR file, or the first of several that are alike."""
    exr: Any = import_extra("OpenEXR", _EXTRA, _USER)
    try:
        lower, upper = exr.File(str(path), header_only=True).header()["dataWindow"]
        if max(high - low for low, high in zip(lower, upper, strict=True)) >= _LONGEST:
            return None
        maps = [channel.pixels for channel in exr.File(str(path), separate_channels=True).channels().values()]
    except (RuntimeError, KeyError, TypeError):
        return None
    if not maps or any(not np.array_equal(other, maps[0], equal_nan=True) for other in maps[1:]):
        return None
    return maps[0]


NOISE = 0.01
"""Share by which the depths of sensors may be wrong: 2 to 3 cm at 3 m."""
_NEAREST, _FARTHEST = 0.02, 500.0
"""Median depth, in what the cameras are apart, beyond which the unit of depths must be another one."""


def read_depth(file: DepthFile) -> Float[np.ndarray, "h w"]:
    """Read depths along the optical axis, in the capture's units. Raises CaptureError for files that hold none."""
    stored = stored_map(file.path, file.size, np.float32)
    if stored is None or stored.ndim != 2 or stored.dtype == np.uint8:
        raise CaptureError(
            f"{file.path} is no readable depth map: one channel of 16-bit or floating-point numbers is needed, "
            "as .png, .tiff, .npy or .exr"
        )
    depth = stored.astype(np.float32) * np.float32(file.unit)
    if not np.isfinite(depth).all() or (depth < 0).any():
        raise CaptureError(
            f"{file.path} has depths that are NaN, infinite or below 0: write 0 where nothing was measured"
        )
    return np.where(_trusted(file, depth.shape) & (depth <= file.farthest), depth, np.float32(0))


def _trusted(file: DepthFile, shape: tuple[int, ...]) -> np.ndarray:
    """Mask of trusted depths. Raises CaptureError for a confidence map that does not fit its depth map."""
    if file.confidence is None:
        return np.ones(shape, bool)
    levels = stored_map(file.confidence, file.size, np.uint8)
    if levels is None or levels.shape != shape:
        wrong = "cannot be read" if levels is None else f"has {levels.shape[1]} x {levels.shape[0]} pixels"
        raise CaptureError(
            f"the confidence map {file.confidence} {wrong}: one channel of {shape[1]} x {shape[0]} is needed, as its "
            "depth map has"
        )
    return levels > 0


def convert_to_ray_depths(
    depth: Float[np.ndarray, "h w"], picture: Picture, camera: Camera, view: View
) -> Float[np.ndarray, "h w"]:
    """Convert the depth map of a picture to distances along the rays of `camera`.

    They are those of `camera` at the map's own resolution. Raises CaptureError where the map has another shape than
    its picture.
    """
    height, width = depth.shape
    own = picture.camera
    path = None if view.depth is None else view.depth.path
    if abs(width / height * own.height / own.width - 1) > ASPECT + 1 / min(width, height):
        raise CaptureError(
            f"the depth map {path} of {width} x {height} pixels has another shape than its picture {view.name}: "
            "depth must be registered to the colours"
        )
    fine = camera.resized(
        max(1, round(camera.width * width / own.width)), max(1, round(camera.height * height / own.height))
    )
    if picture.distortion or own.resized(width, height) != fine:
        maps = undistortion(own.resized(width, height), picture.distortion, fine)
        depth = cv2.remap(depth, *maps, cv2.INTER_NEAREST, borderMode=cv2.BORDER_CONSTANT, borderValue=0)
    ahead = -fine.directions(fine.pixels())[:, 2].reshape(fine.height, fine.width).numpy()
    return depth / ahead


def require_units(depths: Float[Tensor, "n h w"], centers: Float[np.ndarray, "n 3"]) -> None:
    """Raise CaptureError where depths [m] cannot be in the unit that the cameras' positions [m] are in."""
    measured = depths[depths > 0]
    if len(measured) == 0:
        raise CaptureError("the depth maps hold no depth at all: every pixel is 0")
    middle = float(measured.median())
    extent = float(np.linalg.norm(centers - centers.mean(0), axis=1).mean())
    if not _NEAREST * extent <= middle <= _FARTHEST * extent:
        raise CaptureError(
            f"half of the depths are above {middle:.3g} m although the cameras are {extent:.3g} m apart: they are in "
            "another unit: set depth_unit_scale_factor (0.001 for millimetres)"
        )


def points_of(
    depths: Float[Tensor, "n h w"], camera: Camera, poses: Float[np.ndarray, "n 4 4"], every: int = 7
) -> Float[np.ndarray, "m 3"]:
    """World points [m] that every so many pixels of depth maps along rays show."""
    pixels = camera.pixels()[::every]
    directions, found = camera.directions(pixels).numpy(), []
    for depth, pose in zip(depths, poses, strict=True):
        along = depth.reshape(-1)[::every].numpy()
        measured = along > 0
        found.append(pose[:3, 3] + along[measured, None] * (directions[measured] @ pose[:3, :3].T))
    return np.concatenate(found)


def stack_depths(maps: list[Float[np.ndarray, "h w"] | None]) -> Float[Tensor, "n h w"]:
    """Stack depth maps, of which there is at least one; 0 for pictures without one.

    Raises CaptureError where they differ in size.
    """
    sizes = {depth.shape for depth in maps if depth is not None}
    if len(sizes) > 1:
        listed = ", ".join(f"{width} x {height}" for height, width in sorted(sizes))
        raise CaptureError(f"the depth maps differ in size ({listed} pixels): make them all alike")
    (size,) = sizes
    return torch.from_numpy(np.stack([np.zeros(size, np.float32) if depth is None else depth for depth in maps]))
