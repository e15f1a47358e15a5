"""The .splat layout of 32 bytes.

It holds, for each splat, position and standard deviations (6 float32), red, green, blue, opacity (4 bytes) and
(w, x, y, z) in steps of 1/128 from -1 (4 bytes).
"""

from pathlib import Path

import numpy as np

from nerfnav.core.errors import InvalidInputError
from nerfnav.importers.core.magic import unlike
from nerfnav.importers.splats.gaussians import Splats, cleaned

_ROW = np.dtype([("center", "<f4", 3), ("scale", "<f4", 3), ("rgba", "u1", 4), ("wxyz", "u1", 4)])


def read_dot_splat(path: Path) -> Splats:
    size = path.stat().st_size
    if size % _ROW.itemsize:
        raise InvalidInputError(
            f"{path} is truncated or no .splat file: its {size} bytes are no multiple of {_ROW.itemsize}"
        )
    rows = np.fromfile(path, _ROW)
    # text and other files read as numbers, too, but as numbers that no place has
    sane = (np.abs(rows["center"]) < 1e6).all(1) & (rows["scale"] >= 0).all(1) & (rows["scale"] < 1e6).all(1)
    if 2 * np.count_nonzero(sane) < len(rows):
        raise InvalidInputError(f"{unlike(path, '.splat file')}: most of its positions and sizes make no sense")
    rgba = rows["rgba"].astype(np.float64) / 255
    wxyzs = (rows["wxyz"].astype(np.float64) - 128) / 128
    return cleaned(rows["center"], rows["scale"], wxyzs, rgba[:, :3], rgba[:, 3])
