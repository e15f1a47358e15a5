"""Splat formats: INRIA's .ply and the .splat of 32 bytes; .spz, .sog, .ksplat and compressed .ply by their own readers.

INRIA's training writes the logit of the opacity, the logarithms of the standard deviations, a quaternion (w, x, y, z)
of any length and spherical harmonics f, of which the first, c = 1/2 + Y_0 f_dc with Y_0 = 1 / (2 sqrt(pi)), is the
mean colour over all directions (the others have mean zero and are left out).

A .splat holds, for each splat, position and standard deviations (6 float32), red, green, blue, opacity (4 bytes) and
(w, x, y, z) in steps of 1/128 from -1 (4 bytes).
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from nerfnav.core.errors import InvalidInputError
from nerfnav.importers.core.kinds import OWN_SPLATS, SPLATS, describe_mismatch
from nerfnav.importers.splats.gaussians import Splats, clean_splats, load_saved_splats, rgb_of
from nerfnav.importers.splats.ksplat import read_ksplat
from nerfnav.importers.splats.ply import columns_of, decode_compressed, ply_columns, read_ply
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


_NEEDED = (
    "x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2",
    "rot_0", "rot_1", "rot_2", "rot_3",
)  # fmt: skip
_PACKED = ("packed_position", "packed_rotation", "packed_scale", "packed_color")
_LARGEST_OPACITY_LOGIT = 30.0  # beyond it the logistic function is 1 in every precision


def load_splats(path: Path) -> Splats:
    """Read splats, in the file's own axes and units, whatever the layout.

    Raises InvalidInputError, in one sentence, where the file is missing, empty, truncated or of another kind.
    """
    if path.is_dir() and (path / META).is_file():
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
    """True for splats: by ending, by a PLY header with the properties of splats (other .ply are meshes), or by a
    meta.json, which may stand for its folder."""
    suffix = path.suffix.lower()
    if path.is_dir():
        return is_sog(path / META)
    if suffix == ".json":
        return path.name.lower() == META and is_sog(path)
    if suffix != ".ply" or not path.is_file():
        return suffix in SPLATS and suffix != ".ply"
    try:
        columns = ply_columns(path).get("vertex", ())
    except InvalidInputError:
        return False
    return set(_NEEDED) <= set(columns) or set(_PACKED) <= set(columns)


def _require_splats(path: Path, splats: Splats) -> Splats:
    if len(splats) == 0:
        raise InvalidInputError(f"{path} holds no usable splat: of {splats.declared} none is finite and of sane size")
    return splats


def _ply(path: Path) -> Splats:
    tables = read_ply(path)
    vertices = tables.get("vertex", np.empty(0, np.dtype([])))
    names = set(vertices.dtype.names or ())
    if set(_PACKED) <= names and "chunk" in tables:
        return decode_compressed(path, tables["chunk"], vertices)
    missing = [name for name in _NEEDED if name not in names]
    if missing:
        raise InvalidInputError(f"{path} is a PLY file without splats: its vertices have no {', '.join(missing)}")
    with np.errstate(over="ignore"):
        logit = vertices["opacity"].astype(np.float64).clip(-_LARGEST_OPACITY_LOGIT, _LARGEST_OPACITY_LOGIT)
        return clean_splats(
            columns_of(vertices, "x", "y", "z"),
            np.exp(columns_of(vertices, "scale_0", "scale_1", "scale_2")),
            columns_of(vertices, "rot_0", "rot_1", "rot_2", "rot_3"),
            rgb_of(columns_of(vertices, "f_dc_0", "f_dc_1", "f_dc_2")),
            1 / (1 + np.exp(-logit)),
        )


_READERS: dict[str, Callable[[Path], Splats]] = {
    ".ply": _ply,
    ".splat": read_dot_splat,
    ".spz": read_spz,
    ".sog": read_sog,
    ".ksplat": read_ksplat,
    ".json": read_sog,
}
