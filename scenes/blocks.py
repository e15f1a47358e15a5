"""The smallest place: five coloured blocks on a slab, quick to build and to learn."""

import numpy as np

from nerfnav.geometry import Box
from nerfnav.world import Scene
from nerfnav_scenes.light import Light, from_srgb, lit
from nerfnav_scenes.noise import fractal
from nerfnav_scenes.primitives import Size, box, place
from nerfnav_scenes.tasks.blocks import TASKS

_EDGE = 0.015
_SLAB: Size = (1.2, 1.2, 0.06)
_BLOCKS: list[tuple[Size, tuple[float, float], float, tuple[float, float, float]]] = [
    # size [m], centre [m], yaw [rad], sRGB colour
    ((0.12, 0.34, 0.40), (0.00, 0.02), 0.15, (0.80, 0.30, 0.22)),
    ((0.16, 0.16, 0.26), (-0.42, 0.34), 0.60, (0.24, 0.52, 0.78)),
    ((0.22, 0.10, 0.18), (0.32, -0.36), -0.35, (0.90, 0.72, 0.24)),
    ((0.13, 0.13, 0.32), (0.36, 0.38), 0.30, (0.35, 0.66, 0.36)),
    ((0.10, 0.20, 0.14), (-0.42, -0.38), -0.80, (0.62, 0.40, 0.70)),
]


def build() -> Scene:
    """Build slab and blocks, and light them."""
    slab = place(box(_SLAB, _EDGE), (0, 0, -_SLAB[2] / 2), 0)
    parts, albedos = [slab], [_mottled(slab.vertices, (0.62, 0.60, 0.52), 1)]
    for seed, (size, (x, y), yaw, color) in enumerate(_BLOCKS, start=2):
        block = place(box(size, _EDGE), (x, y, size[2] / 2 - 0.01), yaw)
        parts.append(block)
        albedos.append(_mottled(block.vertices, color, seed))
    return Scene(
        name="blocks",
        title="Blocks",
        mesh=lit(parts, albedos, Light()),
        solids=tuple(parts),
        box=Box.of((-0.65, -0.65, -0.08), (0.65, 0.65, 0.55)),
        sky=(0.74, 0.84, 0.95),
        tasks=TASKS,
    )


def _mottled(points: np.ndarray, color: tuple[float, float, float], seed: int) -> np.ndarray:
    """Linear colours (n, 3) around an sRGB colour, varied from 16 cm down to 2 cm."""
    shades = np.stack([fractal(points, 0.16, 10 * seed + k, octaves=4, gain=0.7) for k in range(3)], -1)
    return from_srgb(color) * (1 + 0.45 * shades[:, :1] + 0.25 * shades)
