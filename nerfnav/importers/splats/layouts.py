"""Splats in files: INRIA's .ply, the .splat of 32 bytes, SuperSplat's compressed .ply; .spz, .sog, .ksplat by their own
readers.

INRIA's training writes the logit of the opacity, the logarithms of the standard deviations, a quaternion (w, x, y, z)
of any length and spherical harmonics f, of which the first, c = 1/2 + Y_0 f_dc with Y_0 = 1 / (2 sqrt(pi)), is the mean
colour over all directions (the others have mean zero and are left out).

.splat holds, for each splat, position and standard deviations (6 float32), red, green, blue, opacity (4 bytes) and
(w, x, y, z) in steps of 1/128 from -1 (4 bytes).

SuperSplat packs chunks of 256 splats between the chunk's smallest and largest values: positions and logarithms of
standard deviations in 11, 10, 11 bits, colour and opacity in 4 times 8, and the quaternion as the number of its
largest part (2 bits) and the three others in 10 bits each from -1/sqrt(2) to 1/sqrt(2).
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from nerfnav.errors import InvalidInputError
from nerfnav.importers.magic import unlike
from nerfnav.importers.splats.ksplat import read_ksplat
from nerfnav.importers.splats.ply import ply_columns, read_ply
from nerfnav.importers.splats.quaternions import from_smallest_three
from nerfnav.importers.splats.sog import META, is_sog, read_sog
from nerfnav.importers.splats.splats import Splats, cleaned, rgb_of, saved_splats
from nerfnav.importers.splats.spz import read_spz
from nerfnav.importers.suffixes import OWN_SPLATS
from nerfnav.importers.suffixes import SPLATS as SUFFIXES

_ROW = np.dtype([("center", "<f4", 3), ("scale", "<f4", 3), ("rgba", "u1", 4), ("wxyz", "u1", 4)])
_CHUNK = 256
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
        return _some(path, read_sog(path))
    if not path.is_file():
        raise InvalidInputError(f"there is no file of splats {path}")
    if path.stat().st_size == 0:
        raise InvalidInputError(f"{path} is empty: splats were expected")
    if path.name.lower().endswith(OWN_SPLATS):
        return saved_splats(path)
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        raise InvalidInputError(f"{path} is no file of splats: those end in {', '.join(SUFFIXES)}, or are a {META}")
    return _some(path, reader(path))


def holds_splats(path: Path) -> bool:
    """Whether a file is of splats: by its ending, by a PLY header that names what splats have (other .ply are meshes),
    or by what a meta.json describes, which may stand for its folder."""
    suffix = path.suffix.lower()
    if path.is_dir():
        return is_sog(path / META)
    if suffix == ".json":
        return path.name.lower() == META and is_sog(path)
    if suffix != ".ply" or not path.is_file():
        return suffix in SUFFIXES and suffix != ".ply"
    try:
        columns = ply_columns(path).get("vertex", ())
    except InvalidInputError:
        return False
    return set(_NEEDED) <= set(columns) or set(_PACKED) <= set(columns)


def _some(path: Path, splats: Splats) -> Splats:
    if len(splats) == 0:
        raise InvalidInputError(f"{path} holds no usable splat: of {splats.declared} none is finite and of sane size")
    return splats


def _ply(path: Path) -> Splats:
    tables = read_ply(path)
    vertices = tables.get("vertex", np.empty(0, np.dtype([])))
    names = set(vertices.dtype.names or ())
    if set(_PACKED) <= names and "chunk" in tables:
        return _compressed(path, tables["chunk"], vertices)
    missing = [name for name in _NEEDED if name not in names]
    if missing:
        raise InvalidInputError(f"{path} is a PLY file without splats: its vertices have no {', '.join(missing)}")
    with np.errstate(over="ignore"):
        logit = vertices["opacity"].astype(np.float64).clip(-_LARGEST_OPACITY_LOGIT, _LARGEST_OPACITY_LOGIT)
        return cleaned(
            _columns(vertices, "x", "y", "z"),
            np.exp(_columns(vertices, "scale_0", "scale_1", "scale_2")),
            _columns(vertices, "rot_0", "rot_1", "rot_2", "rot_3"),
            rgb_of(_columns(vertices, "f_dc_0", "f_dc_1", "f_dc_2")),
            1 / (1 + np.exp(-logit)),
        )


def _dot_splat(path: Path) -> Splats:
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


def _compressed(path: Path, chunks: np.ndarray, vertices: np.ndarray) -> Splats:
    if len(chunks) != -(-len(vertices) // _CHUNK):
        raise InvalidInputError(
            f"{path} has {len(chunks)} chunks for {len(vertices)} splats, and {-(-len(vertices) // _CHUNK)} are needed"
        )
    chunk = np.arange(len(vertices)) // _CHUNK

    def between(shares: np.ndarray, *names: str) -> np.ndarray:
        if f"min_{names[0]}" not in (chunks.dtype.names or ()):
            return shares  # older files have colours from 0 to 1
        lower = _columns(chunks, *(f"min_{name}" for name in names))[chunk]
        upper = _columns(chunks, *(f"max_{name}" for name in names))[chunk]
        return lower + shares * (upper - lower)

    color = _unpacked(vertices["packed_color"], (24, 8), (16, 8), (8, 8), (0, 8))
    log_scales = between(_unpacked(vertices["packed_scale"], *_11_10_11), "scale_x", "scale_y", "scale_z")
    return cleaned(
        between(_unpacked(vertices["packed_position"], *_11_10_11), "x", "y", "z"),
        np.exp(log_scales.clip(None, 30)),
        _quaternions(vertices["packed_rotation"]),
        between(color[:, :3], "r", "g", "b"),
        color[:, 3],
    )


_11_10_11 = ((21, 11), (11, 10), (0, 11))


def _unpacked(words: np.ndarray, *parts: tuple[int, int]) -> np.ndarray:
    """Shares in [0, 1] of the parts (lowest bit, number of bits) of 32-bit words."""
    return np.stack([((words >> low) & ((1 << bits) - 1)) / ((1 << bits) - 1) for low, bits in parts], 1)


def _quaternions(words: np.ndarray) -> np.ndarray:
    """(w, x, y, z) of words that hold the three smaller parts and the number of the largest."""
    smaller = (_unpacked(words, (20, 10), (10, 10), (0, 10)) - 0.5) * np.sqrt(2)
    return from_smallest_three(smaller, (words >> 30).astype(np.int64))


def _columns(table: np.ndarray, *names: str) -> np.ndarray:
    return np.stack([table[name].astype(np.float64) for name in names], 1)


_READERS: dict[str, Callable[[Path], Splats]] = {
    ".ply": _ply,
    ".splat": _dot_splat,
    ".spz": read_spz,
    ".sog": read_sog,
    ".ksplat": read_ksplat,
    ".json": read_sog,
}
