"""SOG, PlayCanvas' splats in pictures, version 2, by its published specification: a folder's meta.json with lossless
WebP planes beside it, or both in one zip (.sog).

Pixel i, row by row, belongs to splat i. With l and u the pictures of lower and upper bytes, positions are

    t = min + (max - min) (l + 256 u) / 65535,  p = sign(t) (exp |t| - 1)

Scales and colours index codebooks of 256: logarithms of standard deviations, and f_dc. The opacity is sh0's alpha in
steps of 1/255. Quaternions are their smallest three of (w, x, y, z), with 252 plus the number of the largest as alpha.
Harmonics are not read. Version 1 has no codebooks: scales and colours lie between their smallest and largest values.
"""

import io
import json
import zipfile
from collections.abc import Callable
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from nerfnav.core.errors import InvalidInputError
from nerfnav.importers.core.kinds import describe_mismatch, read_head
from nerfnav.importers.splats.gaussians import Splats, clean_splats, from_smallest_three, rgb_of

MOST_BYTES = 1 << 28
"""Bytes of one file in a .sog that are unpacked."""
META = "meta.json"
_PLANES = ("means", "scales", "quats", "sh0")
_TAG = 252
Read = Callable[[str], bytes]


def is_sog(meta: Path) -> bool:
    """True for a meta.json of splats: other programs have files of this name, too."""
    try:
        return is_sog_meta(meta.read_bytes())
    except OSError:
        return False


def is_sog_meta(content: bytes) -> bool:
    """True for the content of a meta.json of splats."""
    try:
        content = json.loads(content)
    except (ValueError, RecursionError):
        return False
    return isinstance(content, dict) and all(isinstance(content.get(name), dict) for name in _PLANES)


def read_sog(path: Path) -> Splats:
    """Read a .sog, a meta.json, or the folder of one.

    Raises InvalidInputError where it is none, or where one of its pictures is missing, cut off or too small.
    """
    meta = path / META if path.is_dir() else path
    if meta.suffix.lower() == ".json":
        return _decoded(path, lambda name: _beside(meta, name), meta.name)
    if not zipfile.is_zipfile(path):
        head = read_head(path)
        if head[:4] == b"PK\x03\x04":
            raise InvalidInputError(f"{path} is truncated: it is a zip archive whose end is missing")
        raise InvalidInputError(describe_mismatch(path, ".sog file of splats", head))
    with _opened(path) as archive:
        names = {entry.filename: entry for entry in archive.infolist()}
        found = min((name for name in names if PurePosixPath(name).name == META), key=len, default=None)
        if found is None:
            raise InvalidInputError(f"{path} is a zip archive without {META}: it is no .sog file of splats")
        folder = found.removesuffix(META)

        def inside(name: str) -> bytes:
            entry = names.get(folder + name)
            if entry is None:
                raise InvalidInputError(f"{path} lacks {name}, which its {META} names")
            if entry.file_size > MOST_BYTES:
                raise InvalidInputError(f"{path} holds {name} of {entry.file_size >> 20} MB, which no splats need")
            try:
                return archive.read(entry)
            except Exception as error:  # zipfile and its compressions raise anything for damage
                raise InvalidInputError(f"{path} is damaged: {name} in it cannot be unpacked") from error

        return _decoded(path, inside, META)


def _opened(path: Path) -> zipfile.ZipFile:
    try:
        return zipfile.ZipFile(path)
    except Exception as error:  # zipfile raises anything for damage
        raise InvalidInputError(f"{path} is damaged: its zip archive cannot be read") from error


def _beside(meta: Path, name: str) -> bytes:
    file = (meta.parent / name).resolve()
    if not file.is_relative_to(meta.parent.resolve()):
        raise InvalidInputError(f"{meta} names {name}, which lies outside its own folder: it is not read")
    try:
        return file.read_bytes()
    except OSError as error:
        raise InvalidInputError(f"{meta} needs {name}, which cannot be read: {error.strerror}") from error


def _decoded(path: Path, read: Read, name: str) -> Splats:
    try:
        meta = json.loads(read(name))
    except (ValueError, RecursionError) as error:
        raise InvalidInputError(f"{path} is truncated or damaged: its {META} is no JSON") from error
    try:
        if not isinstance(meta, dict) or not all(isinstance(meta[part], dict) for part in _PLANES):
            raise KeyError
        version = meta.get("version", 1)
        count = int(meta["count"] if version != 1 else meta["means"]["shape"][0])
        numbers = [np.array(meta["means"][end], np.float64) for end in ("mins", "maxs")]
        files = {part: [str(file) for file in meta[part]["files"]] for part in _PLANES}
        lower_file, upper_file = files["means"]
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise InvalidInputError(f"{path} has a {META} that describes no splats as SOG does") from error
    if version not in (1, 2):
        raise InvalidInputError(f"{path} is of version {version} of SOG; versions 1 and 2 are known: export it anew")
    if count < 1 or any(end.shape != (3,) for end in numbers):
        raise InvalidInputError(f"{path} has a {META} of {count} splats or with wrong limits: it is damaged")

    low, high = (_plane(path, read, file, count)[:, :3].astype(np.float64) for file in (lower_file, upper_file))
    t = numbers[0] + (numbers[1] - numbers[0]) * (low + 256 * high) / 65535
    quats, scales, colors = (_plane(path, read, files[part][0], count) for part in ("quats", "scales", "sh0"))
    largest = quats[:, 3].astype(np.int64) - _TAG
    known = (largest >= 0) & (largest < 4)
    wxyzs = from_smallest_three((quats[:, :3] / 255 * 2 - 1) * np.sqrt(0.5), np.where(known, largest, 0))
    wxyzs[~known] = (1.0, 0.0, 0.0, 0.0)
    color, opacity = _looked_up(path, meta["sh0"], colors), colors[:, 3] / 255
    if version == 1:  # the opacity is a logit, among the colours' own limits
        color, opacity = color[:, :3], 1 / (1 + np.exp(-color[:, 3]))
    with np.errstate(over="ignore"):
        size = np.exp(_looked_up(path, meta["scales"], scales)[:, :3])
    return clean_splats(np.sign(t) * np.expm1(np.abs(t)), size, wxyzs, rgb_of(color[:, :3]), opacity)


def _plane(path: Path, read: Read, file: str, count: int) -> np.ndarray:
    """The first `count` pixels of a picture (count, 4)."""
    from PIL import Image  # most places are opened without one

    try:
        with Image.open(io.BytesIO(read(file))) as image:
            if image.width * image.height < count:
                raise InvalidInputError(
                    f"{path} is cut off: {file} has {image.width} x {image.height} pixels for {count} splats"
                )
            return np.asarray(image.convert("RGBA")).reshape(-1, 4)[:count]
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise InvalidInputError(f"{path} is damaged: {file} is truncated or no picture") from error


def _looked_up(path: Path, entry: dict[str, Any], pixels: np.ndarray) -> np.ndarray:
    """Decode pixels: entries of a codebook (version 2), or values between limits (version 1)."""
    try:
        if "codebook" in entry:
            return np.array(entry["codebook"], np.float64)[pixels[:, :3]]
        lower, upper = (np.array(entry[end], np.float64) for end in ("mins", "maxs"))
        return lower + (upper - lower) * pixels[:, : len(lower)] / 255
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise InvalidInputError(f"{path} is damaged: the codebooks in its {META} do not fit its pictures") from error
