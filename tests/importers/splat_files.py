"""Files of splats in all layouts, written from the layouts' descriptions by other means than they are read."""

import gzip
import io
import json
import math
import struct
import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import zstandard
from PIL import Image


@dataclass(frozen=True)
class Gaussians:
    """n splats as files state them."""

    centers: np.ndarray
    scales: np.ndarray
    wxyzs: np.ndarray
    rgbs: np.ndarray
    opacities: np.ndarray

    def covariance(self, index: int) -> np.ndarray:
        """By Rodrigues' formula for unit quaternions, one splat at a time."""
        w, *v = self.wxyzs[index] / np.linalg.norm(self.wxyzs[index])
        cross = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
        rotation = np.eye(3) + 2 * w * cross + 2 * cross @ cross
        return rotation @ np.diag(self.scales[index] ** 2) @ rotation.T


def some_splats(count: int, seed: int = 0) -> Gaussians:
    """Splats of all shapes and colours."""
    rng = np.random.default_rng(seed)
    return Gaussians(
        rng.uniform(-1, 1, (count, 3)),
        np.exp(rng.uniform(-5, -2, (count, 3))),
        rng.normal(size=(count, 4)),
        rng.uniform(0, 1, (count, 3)),
        rng.uniform(0.05, 0.95, count),
    )


def ball_of_splats(count: int, radius: float = 0.5) -> Gaussians:
    """Flat splats that cover a sphere, thin along its radius."""
    index = np.arange(count) + 0.5
    height, turn = 1 - 2 * index / count, index * math.pi * (3 - math.sqrt(5))
    around = np.sqrt(1 - height**2)
    normals = np.stack([around * np.cos(turn), around * np.sin(turn), height], 1)
    wide = radius * math.sqrt(4 * math.pi / count)
    wxyzs = np.stack([1 + normals[:, 2], -normals[:, 1], normals[:, 0], np.zeros(count)], 1)  # z to the normal
    scales = np.tile([wide, wide, 0.1 * wide], (count, 1))
    return Gaussians(radius * normals, scales, wxyzs, 0.5 + 0.4 * normals, np.full(count, 0.95))


def write_dot_splat(path: Path, splats: Gaussians) -> None:
    """The layout of 32 bytes."""
    rows = bytearray()
    for center, scale, wxyz, rgb, opacity in _each(splats):
        unit = wxyz / np.linalg.norm(wxyz)
        rows += struct.pack("<6f", *center, *scale)
        rows += bytes([*(round(255 * part) for part in rgb), round(255 * opacity)])
        rows += bytes(int(np.clip(round(128 + 128 * part), 0, 255)) for part in unit)
    path.write_bytes(bytes(rows))


def write_inria(path: Path, splats: Gaussians, declared: int | None = None) -> None:
    """The layout of INRIA's training; `declared` is the count in the header."""
    names = ["x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"]
    names += [f"f_rest_{index}" for index in range(45)]
    names += ["opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]
    count = len(splats.centers) if declared is None else declared
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {count}\n"
    header += "".join(f"property float {name}\n" for name in names) + "end_header\n"
    rows = bytearray(header.encode())
    for center, scale, wxyz, rgb, opacity in _each(splats):
        harmonics = [(part - 0.5) / 0.28209479177387814 for part in rgb] + [0.3] * 45
        logit = math.log(opacity / (1 - opacity))
        rows += struct.pack("<62f", *center, 0, 0, 0, *harmonics, logit, *np.log(scale), *wxyz)
    path.write_bytes(bytes(rows))


def write_compressed(path: Path, splats: Gaussians) -> None:
    """SuperSplat's layout: chunks of 256, everything in 32-bit words."""
    count = len(splats.centers)
    names = [f"{end}_{axis}" for end in ("min", "max") for axis in "xyz"]
    names += [f"{end}_scale_{axis}" for end in ("min", "max") for axis in "xyz"]
    names += [f"{end}_{axis}" for end in ("min", "max") for axis in "rgb"]
    words = ["packed_position", "packed_rotation", "packed_scale", "packed_color"]
    header = "ply\nformat binary_little_endian 1.0\n"
    header += f"element chunk {-(-count // 256)}\n" + "".join(f"property float {name}\n" for name in names)
    header += f"element vertex {count}\n" + "".join(f"property uint {name}\n" for name in words) + "end_header\n"
    chunks, rows = bytearray(), bytearray()
    for first in range(0, count, 256):
        part = slice(first, first + 256)
        columns = (splats.centers[part], np.log(splats.scales[part]), splats.rgbs[part])
        ends = [(column.min(0), column.max(0)) for column in columns]
        chunks += struct.pack("<18f", *(number for low, high in ends for number in (*low, *high)))
        shares = [(column - low) / (high - low) for column, (low, high) in zip(columns, ends, strict=True)]
        for at, size, color, wxyz, opacity in zip(
            *shares, splats.wxyzs[part], splats.opacities[part], strict=True
        ):
            quads = [_bits(part, 8) for part in (*color, opacity)]
            word = quads[0] << 24 | quads[1] << 16 | quads[2] << 8 | quads[3]
            rows += struct.pack("<4I", _triple(at), _smallest_three(wxyz), _triple(size), word)
    path.write_bytes(header.encode() + bytes(chunks) + bytes(rows))


def write_spz(path: Path, splats: Gaussians, version: int = 3, bits: int = 12) -> None:
    """Niantic's layout: attribute by attribute, in one gzip stream or, from version 4, a Zstandard stream each."""
    columns = [bytearray() for _ in range(5)]
    for center, scale, wxyz, rgb, opacity in _each(splats):
        w, *xyz = wxyz / np.linalg.norm(wxyz)
        for part in center:
            columns[0] += round(part * (1 << bits)).to_bytes(3, "little", signed=True)
        columns[1].append(round(255 * opacity))
        columns[2] += bytes(round(255 * (0.5 + 0.15 * (part - 0.5) / 0.28209479177387814)) for part in rgb)
        columns[3] += bytes(round(16 * (math.log(part) + 10)) for part in scale)
        if version == 2:
            columns[4] += bytes(round(127.5 * (1 + part * (1 if w >= 0 else -1))) for part in xyz)
        else:
            columns[4] += _signed_smallest_three([*xyz, w]).to_bytes(4, "little")
    columns.append(bytearray())  # harmonics of degree 0
    header = struct.pack("<4sIIBBBB", b"NGSP", version, len(splats.centers), 0, bits, 0, 6 if version == 4 else 0)
    if version < 4:
        path.write_bytes(gzip.compress(header + b"".join(columns)))
        return
    streams = [zstandard.ZstdCompressor().compress(bytes(column)) for column in columns]
    table = b"".join(
        struct.pack("<QQ", len(stored), len(column)) for stored, column in zip(streams, columns, strict=True)
    )
    path.write_bytes(header + struct.pack("<I12x", 32) + table + b"".join(streams))


def write_sog(folder: Path, splats: Gaussians, width: int = 32) -> None:
    """PlayCanvas' layout: pictures of one pixel a splat, and a meta.json that says what they stand for."""
    folder.mkdir(parents=True, exist_ok=True)
    count = len(splats.centers)
    logs = np.sign(splats.centers) * np.log1p(np.abs(splats.centers))
    steps = np.rint(65535 * (logs - logs.min(0)) / np.ptp(logs, axis=0)).astype(np.int64)
    sizes, colors = np.linspace(-6, -1, 256), np.linspace(-2, 2, 256)
    wanted = (splats.rgbs - 0.5) / 0.28209479177387814
    planes = {
        "means_l": steps & 255,
        "means_u": steps >> 8,
        "scales": np.abs(np.log(splats.scales)[..., None] - sizes).argmin(-1),
        "sh0": np.column_stack([np.abs(wanted[..., None] - colors).argmin(-1), np.rint(255 * splats.opacities)]),
        "quats": np.array([_tagged_smallest_three(wxyz) for wxyz in splats.wxyzs]),
    }
    for name, values in planes.items():
        pixels = np.full((-(-count // width) * width, 4), 255, np.uint8)
        pixels[:count, : values.shape[1]] = values
        Image.fromarray(pixels.reshape(-1, width, 4)).save(folder / f"{name}.webp", lossless=True, exact=True)
    meta = {
        "version": 2,
        "count": count,
        "means": {"mins": [*logs.min(0)], "maxs": [*logs.max(0)], "files": ["means_l.webp", "means_u.webp"]},
        "scales": {"codebook": [*sizes], "files": ["scales.webp"]},
        "quats": {"files": ["quats.webp"]},
        "sh0": {"codebook": [*colors], "files": ["sh0.webp"]},
    }
    (folder / "meta.json").write_text(json.dumps(meta))


def bundle_sog(path: Path, splats: Gaussians) -> None:
    """The same as one archive."""
    folder = path.with_name(path.name + "_parts")
    write_sog(folder, splats)
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for file in sorted(folder.iterdir()):
            archive.write(file, file.name)
    path.write_bytes(packed.getvalue())


def write_ksplat(path: Path, splats: Gaussians, level: int = 1, degree: int = 1) -> None:
    """mkkellogg's layout, in two sections; buckets of 40 splats with one of them partly filled."""
    half = len(splats.centers) // 2
    parts = [slice(0, half), slice(half, len(splats.centers))]
    heads, bodies = bytearray(), bytearray()
    for part in parts:
        head, body = _ksplat_section(splats, part, level, degree)
        heads += head
        bodies += body
    header = bytearray(4096)
    struct.pack_into("<BBHIIIIH", header, 0, 0, 1, 0, 2, 2, len(splats.centers), len(splats.centers), level)
    path.write_bytes(bytes(header) + bytes(heads) + bytes(bodies))


def _ksplat_section(splats: Gaussians, part: slice, level: int, degree: int) -> tuple[bytes, bytes]:
    centers, size = splats.centers[part], 40
    groups = [slice(first, min(first + size, len(centers))) for first in range(0, len(centers), size)]
    full = sum(group.stop - group.start == size for group in groups)
    middles = [0.5 * (centers[group].min(0) + centers[group].max(0)) for group in groups]
    edge = 1.01 * max(np.ptp(centers[group], axis=0).max() for group in groups)
    body = bytearray()
    if level > 0:
        for group in groups[full:]:
            body += struct.pack("<I", group.stop - group.start)
        for middle in middles:
            body += struct.pack("<3f", *middle)
    harmonics = bytes((0, 9, 24)[degree] * (4, 2, 1)[level])
    rows = zip(centers, splats.scales[part], splats.wxyzs[part], splats.rgbs[part], splats.opacities[part], strict=True)
    for index, (center, scale, wxyz, rgb, opacity) in enumerate(rows):
        unit = wxyz / np.linalg.norm(wxyz)
        if level == 0:
            body += struct.pack("<10f", *center, *scale, *unit)
        else:
            steps = np.rint(2 * 32767 * (center - middles[index // size]) / edge + 32767).astype(int)
            body += struct.pack("<3H7e", *steps, *scale, *unit)
        body += bytes([*(round(255 * color) for color in rgb), round(255 * opacity)]) + harmonics
    head = bytearray(1024)
    buckets, partial = (len(groups), len(groups) - full) if level else (0, 0)
    struct.pack_into("<IIIIfHxxI", head, 0, len(centers), len(centers), size, buckets, edge, 12, 32767)
    struct.pack_into("<II", head, 32, full if level else 0, partial)
    struct.pack_into("<H", head, 40, degree)
    return bytes(head), bytes(body)


def _signed_smallest_three(xyzw: list[float]) -> int:
    """The number of the largest part, then the others as a sign and nine bits, x first."""
    largest = int(np.abs(xyzw).argmax())
    turned = np.array(xyzw) * np.sign(xyzw[largest])
    word = largest
    for index in range(4):
        if index != largest:
            word = word << 10 | (int(turned[index] < 0) << 9) | round(abs(turned[index]) * math.sqrt(2) * 511)
    return word


def _tagged_smallest_three(wxyz: np.ndarray) -> list[int]:
    unit = wxyz / np.linalg.norm(wxyz)
    largest = int(np.abs(unit).argmax())
    unit = unit * np.sign(unit[largest])
    others = [round(255 * (unit[index] * math.sqrt(0.5) + 0.5)) for index in range(4) if index != largest]
    return [*others, 252 + largest]


def _triple(shares: np.ndarray) -> int:
    x, y, z = shares
    return _bits(x, 11) << 21 | _bits(y, 10) << 11 | _bits(z, 11)


def _smallest_three(wxyz: np.ndarray) -> int:
    unit = wxyz / np.linalg.norm(wxyz)
    largest = int(np.abs(unit).argmax())
    unit = unit * np.sign(unit[largest])
    word = largest
    for index in range(4):
        if index != largest:
            word = word << 10 | _bits(unit[index] * math.sqrt(0.5) + 0.5, 10)
    return word


def _bits(share: float, count: int) -> int:
    return round(float(share) * ((1 << count) - 1))


def _each(splats: Gaussians) -> zip:
    return zip(splats.centers, splats.scales, splats.wxyzs, splats.rgbs, splats.opacities, strict=True)
