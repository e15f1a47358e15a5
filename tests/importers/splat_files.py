"""Files of splats in all layouts, written from the layouts' descriptions by other means than they are read."""

import math
import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np


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
