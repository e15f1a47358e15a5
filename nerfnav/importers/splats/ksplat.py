"""KSPLAT of mkkellogg's GaussianSplats3D, version 0.1, by what its writer lays down.

Little-endian: a header of 4,096 bytes, one of 1,024 for each section, then the sections: the lengths of partly filled
buckets (4 bytes each), the buckets' middles (3 float32 each), then the splats. A splat is position, standard
deviations, quaternion (w, x, y, z), red, green, blue, opacity (a byte each) and harmonics, which are not read.
Compression level 0 has float32; levels 1 and 2 have float16, and positions of 16 bits q around their bucket's middle m,
for buckets of edge e and a range r:

    p = m + (q - r) e / (2 r)
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from nerfnav.core.errors import InvalidInputError
from nerfnav.importers.core.kinds import identify_data
from nerfnav.importers.splats.gaussians import Splats, clean_splats

_HEADER, _SECTION = 4096, 1024
_RANGE = 32767
_COEFFICIENTS = (0, 9, 24)  # harmonics of a splat, by their degree
_HARMONIC_BYTES = (4, 2, 1)  # by the level
_MOST_SECTIONS = 4096


@dataclass(frozen=True)
class _Section:
    first: int  # its first byte in the file
    splats: int
    bucket_size: int
    buckets: int
    full_buckets: int
    partial_buckets: int
    bucket_bytes: int
    edge: float
    range: int
    row: np.dtype

    @property
    def size(self) -> int:
        """Size in the file [bytes]."""
        return 4 * self.partial_buckets + self.bucket_bytes * self.buckets + self.row.itemsize * self.splats


def read_ksplat(path: Path) -> Splats:
    """Read a .ksplat file. Raises InvalidInputError where it is none, is cut off, or of an unknown version."""
    data = path.read_bytes()
    if (named := identify_data(data[:512])) is not None:
        raise InvalidInputError(f"{path} is no .ksplat file of splats: it is {named}")
    if len(data) < _HEADER:
        raise InvalidInputError(f"{path} is truncated or no .ksplat file: it ends in its header of {_HEADER} bytes")
    words = np.frombuffer(data, "<u4", 11)
    level, count, sections = int(np.frombuffer(data, "<u2", 11)[10]), int(words[4]), int(words[1])
    if (data[0], data[1]) != (0, 1) or level > 2 or not 0 < sections <= _MOST_SECTIONS:
        raise InvalidInputError(
            f"{path} is no .ksplat file of version 0.1: its header says version {data[0]}.{data[1]}, "
            f"compression level {level} and {sections} sections"
        )
    if len(data) < _HEADER + sections * _SECTION:
        raise InvalidInputError(f"{path} is truncated: it ends in the headers of its sections")
    columns: list[tuple[np.ndarray, ...]] = []
    first = _HEADER + sections * _SECTION
    for index in range(sections):
        section = _section(data, index, first, level, path)
        if first + section.size > len(data):
            raise InvalidInputError(
                f"{path} is truncated: section {index + 1} of {sections} ends at byte {first + section.size}, "
                f"and there are {len(data)}"
            )
        columns.append(_rows(data, section, level, path))
        first += section.size
    centers, scales, wxyzs, rgba = (np.concatenate(parts)[:count] for parts in zip(*columns, strict=True))
    return clean_splats(centers, scales, wxyzs, rgba[:, :3] / 255, rgba[:, 3] / 255)


def _section(data: bytes, index: int, first: int, level: int, path: Path) -> _Section:
    at = _HEADER + index * _SECTION
    words, halves = np.frombuffer(data, "<u4", 11, at), np.frombuffer(data, "<u2", 22, at)
    degree = int(halves[20])
    if degree >= len(_COEFFICIENTS):
        raise InvalidInputError(f"{path} is damaged: a section has harmonics of degree {degree}; 0 to 2 exist")
    number = "<f4" if level == 0 else "<f2"
    row = np.dtype([
        ("center", "<f4" if level == 0 else "<u2", 3), ("scale", number, 3), ("wxyz", number, 4), ("rgba", "u1", 4),
        ("harmonics", "u1", _COEFFICIENTS[degree] * _HARMONIC_BYTES[level]),
    ])  # fmt: skip
    edge = float(np.frombuffer(data, "<f4", 1, at + 16)[0])
    splats, bucket_size, buckets, _, _, span, _, full, partial = (int(word) for word in words[1:10])
    return _Section(
        first, splats, bucket_size, buckets, full, partial, int(halves[10]), edge, span or _RANGE, row
    )


def _rows(data: bytes, section: _Section, level: int, path: Path) -> tuple[np.ndarray, ...]:
    """Positions (n, 3), standard deviations (n, 3), quaternions (n, 4) and bytes of colour and opacity (n, 4)."""
    after = section.first + 4 * section.partial_buckets
    rows = np.frombuffer(data, section.row, section.splats, after + section.bucket_bytes * section.buckets)
    centers = rows["center"].astype(np.float64)
    if level > 0:
        if section.bucket_bytes != 12 or section.bucket_size == 0:
            raise InvalidInputError(f"{path} is damaged: its buckets have {section.bucket_bytes} bytes, not 12")
        middles = np.frombuffer(data, "<f4", 3 * section.buckets, after).reshape(-1, 3)
        step = section.edge / (2 * section.range)
        centers = middles[_buckets(data, section, path)] + (centers - section.range) * step
    return centers, rows["scale"].astype(np.float64), rows["wxyz"].astype(np.float64), rows["rgba"]


def _buckets(data: bytes, section: _Section, path: Path) -> np.ndarray:
    """Bucket of each splat (n): full ones come first, then those with stored lengths."""
    wrong = InvalidInputError(f"{path} is damaged: its buckets do not hold its {section.splats} splats")
    if section.full_buckets + section.partial_buckets > section.buckets:
        raise wrong
    lengths = np.frombuffer(data, "<u4", section.partial_buckets, section.first)
    ends = np.cumsum(np.concatenate([np.full(section.full_buckets, section.bucket_size), lengths]).astype(np.int64))
    if len(ends) == 0 or ends[-1] < section.splats:
        raise wrong
    return np.searchsorted(ends, np.arange(section.splats), side="right")
