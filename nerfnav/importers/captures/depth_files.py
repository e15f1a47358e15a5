"""Files of depth maps, as numbers: PNG, TIFF and NumPy's .npy; OpenEXR; and Record3D's LZFSE-compressed floats.

What reads the last two is an extra, `nerfnav[depth]`, for few captures have them.
"""

from pathlib import Path
from typing import Any

import cv2
import numpy as np

from nerfnav.extras import from_extra
from nerfnav.importers.captures.views import CaptureError, DepthFile

_EXTRA = "depth"
_USER = "the depth of this capture (--depth off learns from its pictures alone)"
_LONGEST = 8192
"""Pixels along a side of the largest map that is read."""
_MOST_PACKED = 16 << 20
"""Bytes of the largest compressed map: what it swells to is only known afterwards."""


def stored_depth(file: DepthFile) -> np.ndarray | None:
    """The numbers in a file as they are stored; None where it is no whole file of a known kind.

    Raises CaptureError for a map of another size than its capture says, and MissingExtraError for a kind that an extra
    reads.
    """
    return _stored(file.path, file.size, np.float32)


def stored_confidence(file: DepthFile) -> np.ndarray | None:
    """How sure a file's depths are, as stored: 0 is unsure; None where nothing tells, or the file cannot be read."""
    return None if file.confidence is None else _stored(file.confidence, file.size, np.uint8)


def _stored(path: Path, size: tuple[int, int] | None, kind: type) -> np.ndarray | None:
    try:
        if not path.is_file():
            return None
        if path.suffix in (".depth", ".conf"):
            return _unpacked(path, size, kind)
        if path.suffix.lower() == ".exr":
            return _exr(path)
        if path.suffix.lower() == ".npy":
            return np.load(path, allow_pickle=False)
        return cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    except (OSError, ValueError, EOFError, cv2.error):
        return None


def _unpacked(path: Path, size: tuple[int, int] | None, kind: type) -> np.ndarray | None:
    """Rows of a map of `size` (width, height) that LZFSE has compressed."""
    lzfse: Any = from_extra("lzfse", _EXTRA, _USER)
    if size is None:
        raise CaptureError(f"{path} does not tell how large it is: its capture's metadata lack dw and dh, in pixels")
    if path.stat().st_size > _MOST_PACKED:
        return None
    try:
        numbers = np.frombuffer(lzfse.decompress(path.read_bytes()), kind)
    except (lzfse.error, MemoryError, ValueError):
        return None
    if len(numbers) != size[0] * size[1]:
        raise CaptureError(
            f"{path} holds {len(numbers)} numbers, not the {size[0]} x {size[1]} that the metadata (dw, dh) tell"
        )
    return numbers.reshape(size[1], size[0])


def _exr(path: Path) -> np.ndarray | None:
    """The one channel of an OpenEXR file, or the first of several that are alike."""
    exr: Any = from_extra("OpenEXR", _EXTRA, _USER)
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
