"""Splat formats: INRIA's .ply and the .splat of 32 bytes; .spz, .sog, .ksplat and compressed .ply by their own readers.

INRIA's training writes the logit of the opacity, the logarithms of the standard deviations, a quaternion (w, x, y, z)
of any length and spherical harmonics f, of which the first, c = 1/2 + Y_0 f_dc with Y_0 = 1 / (2 sqrt(pi)), is the
mean colour over all directions (the others have mean zero and are left out). Other programs write red, green and blue
in place of f_dc. 2D Gaussian splatting (Huang et al., SIGGRAPH 2024) has discs, two standard deviations each: the
third is 0.

Training leaves a folder with point_cloud/iteration_N/point_cloud.ply, of which the last iteration counts. A folder or a
.zip may also hold one file of splats, or the parts of a SOG.

A .splat holds, for each splat, position and standard deviations (6 float32), red, green, blue, opacity (4 bytes) and
(w, x, y, z) in steps of 1/128 from -1 (4 bytes).
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from nerfnav.core.errors import InvalidInputError
from nerfnav.importers.core.kinds import OWN_SPLATS, SPLATS, describe_mismatch
from nerfnav.importers.splats.containers import is_container, list_splats, unpack_splats
from nerfnav.importers.splats.gaussians import Splats, clean_splats, load_saved_splats, rgb_of
from nerfnav.importers.splats.ksplat import read_ksplat
from nerfnav.importers.splats.ply import (
    HARMONICS,
    NEEDED,
    PACKED,
    RGB,
    THIRD_SCALE,
    columns_of,
    decode_compressed,
    is_splat_header,
    read_ply,
)
from nerfnav.importers.splats.sog import META, is_sog, read_sog
from nerfnav.importers.splats.spz import read_spz

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
        raise InvalidInputError(
            f"{describe_mismatch(path, '.splat file')}: most of its positions and sizes make no sense"
        )
    rgba = rows["rgba"].astype(np.float64) / 255
    wxyzs = (rows["wxyz"].astype(np.float64) - 128) / 128
    return clean_splats(rows["center"], rows["scale"], wxyzs, rgba[:, :3], rgba[:, 3])


_LARGEST_OPACITY_LOGIT = 30.0  # beyond it the logistic function is 1 in every precision


def load_splats(path: Path) -> Splats:
    """Read splats, in the file's own axes and units, whatever the layout.

    Raises InvalidInputError, in one sentence, where the file is missing, empty, truncated or of another kind.
    """
    if is_container(path):
        with unpack_splats(path) as file:
            return load_splats(file)
    if path.is_dir():
        return _require_splats(path, read_sog(path))
    if not path.is_file():
        raise InvalidInputError(f"there is no file of splats {path}")
    if path.stat().st_size == 0:
        raise InvalidInputError(f"{path} is empty: splats were expected")
    if path.name.lower().endswith(OWN_SPLATS):
        return load_saved_splats(path)
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        raise InvalidInputError(f"{path} is no file of splats: those end in {', '.join(SPLATS)}, or are a {META}")
    return _require_splats(path, reader(path))


def holds_splats(path: Path) -> bool:
    """True for splats: by ending, by a PLY header with the properties of splats (other .ply are meshes), by a
    meta.json, which may stand for its folder, or in a folder or an archive."""
    if is_container(path):
        return bool(list_splats(path))
    suffix = path.suffix.lower()
    if path.is_dir():
        return is_sog(path / META)
    if suffix == ".json":
        return path.name.lower() == META and is_sog(path)
    if suffix != ".ply" or not path.is_file():
        return suffix in SPLATS and suffix != ".ply"
    return is_splat_header(path)


def _require_splats(path: Path, splats: Splats) -> Splats:
    if len(splats) == 0:
        raise InvalidInputError(f"{path} holds no usable splat: of {splats.declared} none is finite and of sane size")
    return splats


def _ply(path: Path) -> Splats:
    tables = read_ply(path)
    vertices = tables.get("vertex", np.empty(0, np.dtype([])))
    names = set(vertices.dtype.names or ())
    if set(PACKED) <= names and "chunk" in tables:
        return decode_compressed(path, tables["chunk"], vertices)
    colour = HARMONICS if names.issuperset(HARMONICS) or not names.issuperset(RGB) else RGB
    missing = [name for name in (*colour, *NEEDED) if name not in names]
    if missing:
        raise InvalidInputError(f"{path} is a PLY file without splats: its vertices have no {', '.join(missing)}")
    with np.errstate(over="ignore"):
        logit = vertices["opacity"].astype(np.float64).clip(-_LARGEST_OPACITY_LOGIT, _LARGEST_OPACITY_LOGIT)
        scales = np.exp(columns_of(vertices, "scale_0", "scale_1", *([THIRD_SCALE] if THIRD_SCALE in names else ())))
        return clean_splats(
            columns_of(vertices, "x", "y", "z"),
            np.pad(scales, ((0, 0), (0, 3 - scales.shape[1]))),
            columns_of(vertices, "rot_0", "rot_1", "rot_2", "rot_3"),
            rgb_of(columns_of(vertices, *colour)) if colour is HARMONICS else _rgb_columns(vertices),
            1 / (1 + np.exp(-logit)),
        )


def _rgb_columns(vertices: np.ndarray) -> np.ndarray:
    """Colours (n, 3) of red, green and blue: integers in steps of their largest number, or floats in [0, 1]."""
    largest = [1.0 if (kind := vertices.dtype[name]).kind == "f" else np.iinfo(kind).max for name in RGB]
    return columns_of(vertices, *RGB) / largest


_READERS: dict[str, Callable[[Path], Splats]] = {
    ".ply": _ply,
    ".splat": read_dot_splat,
    ".spz": read_spz,
    ".sog": read_sog,
    ".ksplat": read_ksplat,
    ".json": read_sog,
}
