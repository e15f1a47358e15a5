"""SuperSplat's compressed .ply.

It packs chunks of 256 splats between the chunk's smallest and largest values: positions and logarithms of standard
deviations in 11, 10, 11 bits, colour and opacity in 4 times 8, and the quaternion as the number of its largest part
(2 bits) and the three others in 10 bits each from -1/sqrt(2) to 1/sqrt(2).
"""

from pathlib import Path

import numpy as np

from nerfnav.errors import InvalidInputError
from nerfnav.importers.splats.quaternions import from_smallest_three
from nerfnav.importers.splats.splats import Splats, cleaned

_CHUNK = 256


def compressed(path: Path, chunks: np.ndarray, vertices: np.ndarray) -> Splats:
    if len(chunks) != -(-len(vertices) // _CHUNK):
        raise InvalidInputError(
            f"{path} has {len(chunks)} chunks for {len(vertices)} splats, and {-(-len(vertices) // _CHUNK)} are needed"
        )
    chunk = np.arange(len(vertices)) // _CHUNK

    def between(shares: np.ndarray, *names: str) -> np.ndarray:
        if f"min_{names[0]}" not in (chunks.dtype.names or ()):
            return shares  # older files have colours from 0 to 1
        lower = columns_of(chunks, *(f"min_{name}" for name in names))[chunk]
        upper = columns_of(chunks, *(f"max_{name}" for name in names))[chunk]
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


def columns_of(table: np.ndarray, *names: str) -> np.ndarray:
    return np.stack([table[name].astype(np.float64) for name in names], 1)
