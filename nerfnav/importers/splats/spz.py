"""SPZ, Niantic's packed splats, versions 2 to 4, by its published description (nianticlabs/spz).

Little-endian: magic "NGSP", version, count n, then bytes: degree of harmonics, fractional bits b of positions, flags,
and one more. After it, attribute by attribute:

    positions   9 n bytes     24-bit fixed point with b fractional bits
    opacities   n bytes       in steps of 1/255
    colours     3 n bytes     c in steps of 1/255, of which f_dc = (c - 1/2) / 0.15
    scales      3 n bytes     s, whose logarithm is s / 16 - 10
    rotations   3 n (version 2): x, y, z in steps of 1/127.5 from -1, w >= 0; 4 n (3 and later): the smallest three of
                x, y, z, w in 10 bits (sign and magnitude), the number of the largest in the upper 2

and harmonics, which are not read. Versions up to 3 are one gzip stream; version 4 has a header of 32 bytes, a table of
contents and a Zstandard stream for each attribute. Axes are right, up, back unless an extension defines others.
"""

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from nerfnav.core.errors import InvalidInputError
from nerfnav.importers.core.kinds import HEAD_BYTES, describe_mismatch
from nerfnav.importers.splats.gaussians import XYZW, Splats, clean_splats, from_smallest_three, rgb_of

MOST_SPLATS = 20_000_000
"""More are refused before memory is taken for them."""
_MAGIC, _GZIP = b"NGSP", b"\x1f\x8b"
_HEADER = struct.Struct("<4sIIBBBB")
_TABLE = struct.Struct("<I12x")  # follows the header in version 4
_STREAM = struct.Struct("<QQ")  # bytes of a stream as stored, and as they unpack
_UNKNOWN = -1  # size of a Zstandard stream that does not say it
_HAS_EXTENSIONS = 2
_AXES_EXTENSION = 0xADBE0003
_RIGHT_UP_BACK = 4
_COLOR_SCALE = 0.15


@dataclass(frozen=True)
class _Contents:
    version: int
    count: int  # of splats
    bits: int  # fractional ones of positions
    attributes: list[bytes]  # positions, opacities, colours, scales and rotations


def read_spz(path: Path) -> Splats:
    """Read an .spz file. Raises InvalidInputError where it is none, is cut off, or of an unknown version."""
    data = path.read_bytes()
    if data[:2] == _GZIP:
        return _decoded(path, _gzipped(path, data))
    if data[:4] == _MAGIC:
        return _decoded(path, _zstandard(path, data))
    raise InvalidInputError(describe_mismatch(path, ".spz file of splats", data[:HEAD_BYTES]))


def _gzipped(path: Path, data: bytes) -> _Contents:
    """Unpack a file of versions 1 to 3."""
    unzip = zlib.decompressobj(16 + zlib.MAX_WBITS)
    try:
        head = unzip.decompress(data, _HEADER.size)
        if len(head) < _HEADER.size or head[:4] != _MAGIC:
            raise InvalidInputError(f"{path} is no .spz file of splats: it is gzip data of something else")
        _, version, count, _, bits, _, _ = _HEADER.unpack(head)
        sizes = _sizes(path, version, count)
        # no more than is needed: the file may be malicious, and swell without end
        body = unzip.decompress(unzip.unconsumed_tail, sum(sizes)) if count else b""
    except zlib.error as error:
        raise InvalidInputError(f"{path} is damaged: its gzip data cannot be unpacked") from error
    if len(body) < sum(sizes):
        raise InvalidInputError(
            f"{path} is truncated: its {count} splats take {sum(sizes)} bytes, but there are {len(body)}"
        )
    ends = np.cumsum([0, *sizes])
    return _Contents(version, count, bits, [body[first:end] for first, end in pairwise(ends)])


def _zstandard(path: Path, data: bytes) -> _Contents:
    """Unpack a file of version 4."""
    import zstandard

    if len(data) < _HEADER.size + _TABLE.size:
        raise InvalidInputError(f"{path} is truncated: it ends in its header")
    _, version, count, _, bits, flags, streams = _HEADER.unpack_from(data)
    sizes = _sizes(path, version, count)
    (table,) = _TABLE.unpack_from(data, _HEADER.size)
    at = table + streams * _STREAM.size
    if streams < len(sizes) or at > len(data):
        raise InvalidInputError(f"{path} is truncated or damaged: its table of contents is not in it")
    if flags & _HAS_EXTENSIONS:
        _require_usual_axes(path, data[_HEADER.size + _TABLE.size : table])
    parts = []
    for index, size in enumerate(sizes):
        stored, unpacked = _STREAM.unpack_from(data, table + index * _STREAM.size)
        if at + stored > len(data):
            raise InvalidInputError(f"{path} is truncated: it ends in stream {index + 1} of {streams}")
        stream, part = data[at : at + stored], b""
        try:
            # the library takes memory for as much as a stream says of itself, before it unpacks anything
            says = zstandard.frame_content_size(stream)
            if unpacked == size and says in (size, _UNKNOWN):
                part = zstandard.ZstdDecompressor().decompress(stream, max_output_size=size)
        except zstandard.ZstdError as error:
            raise InvalidInputError(f"{path} is damaged: its stream {index + 1} cannot be unpacked") from error
        if len(part) != size or unpacked != size:
            raise InvalidInputError(f"{path} is damaged: its stream {index + 1} has another size than its splats take")
        parts.append(part)
        at += stored
    return _Contents(version, count, bits, parts)


def _sizes(path: Path, version: int, count: int) -> list[int]:
    """Bytes of positions, opacities, colours, scales and rotations."""
    if not 2 <= version <= 4:
        raise InvalidInputError(f"{path} is of version {version} of SPZ; versions 2 to 4 are known: export it anew")
    if count > MOST_SPLATS:
        raise InvalidInputError(f"{path} declares {count} splats; at most {MOST_SPLATS} are read: thin them out")
    return [9 * count, count, 3 * count, 3 * count, (3 if version == 2 else 4) * count]


def _require_usual_axes(path: Path, records: bytes) -> None:
    """Refuse other axes than SPZ's own, which are rare; other extensions are about viewers."""
    for kind, payload in _records(records):
        if kind == _AXES_EXTENSION and len(payload) == 4 and int.from_bytes(payload, "little") != _RIGHT_UP_BACK:
            raise InvalidInputError(
                f"{path} has other axes than SPZ's own (right, up, back): export it without its coordinate system"
            )


def _records(data: bytes) -> Iterator[tuple[int, bytes]]:
    while len(data) >= 8:
        kind, size = struct.unpack_from("<II", data)
        yield kind, data[8 : 8 + size]
        data = data[8 + size :]


def _decoded(path: Path, contents: _Contents) -> Splats:
    count, bits = contents.count, contents.bits
    if count == 0:
        raise InvalidInputError(f"{path} holds no splat")
    if bits > 24:
        raise InvalidInputError(f"{path} is damaged: positions of 24 bits cannot have {bits} fractional ones")
    positions, opacities, colors, scales, rotations = (np.frombuffer(part, np.uint8) for part in contents.attributes)
    words = np.zeros((3 * count, 4), np.uint8)
    words[:, 1:] = positions.reshape(-1, 3)  # into the upper bytes, which hold the sign
    centers = (words.view("<i4")[:, 0] >> 8).reshape(count, 3) / float(1 << bits)
    return clean_splats(
        centers,
        np.exp(scales.reshape(count, 3) / 16 - 10.0),
        _first_three(rotations) if contents.version == 2 else _smallest_three(rotations),
        rgb_of((colors.reshape(count, 3) / 255 - 0.5) / _COLOR_SCALE),
        opacities / 255,
    )


def _first_three(rotations: np.ndarray) -> np.ndarray:
    xyz = rotations.reshape(-1, 3) / 127.5 - 1
    return np.column_stack([np.sqrt(np.maximum(0, 1 - (xyz**2).sum(1))), xyz])


def _smallest_three(rotations: np.ndarray) -> np.ndarray:
    words = rotations.view("<u4")
    fields = np.stack([words >> 20, words >> 10, words], 1) & 1023
    smaller = np.where(fields & 512, -1.0, 1.0) * (fields & 511) / 511 * np.sqrt(0.5)
    return from_smallest_three(smaller, (words >> 30).astype(np.int64), XYZW)
