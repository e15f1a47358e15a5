"""Stonehenge in the paper's scale, 2 m across: a ring with lintels, five trilithons, fallen stones, a meadow.

The entrance is in the north-east, as at the real one; the south-western ring has fallen. Stones stand clear of the
ends of all tasks.
"""

from dataclasses import dataclass

import numpy as np
import trimesh

from nerfnav.geometry import Box
from nerfnav.world import Scene
from nerfnav_scenes.light import Light, lit
from nerfnav_scenes.meadow import meadow
from nerfnav_scenes.primitives import EDGE, Roughness, Size, place, stone
from nerfnav_scenes.tasks.stonehenge import TASKS
from nerfnav_scenes.weathering import weathered


@dataclass(frozen=True)
class Block:
    """One stone and how it stands or lies."""

    size: Size
    """Along its own x, y, z before tilting [m]."""
    foot: Size
    """Middle of its underside [m]."""
    yaw_deg: float
    """Heading of its x axis [degrees]."""
    tilt_deg: tuple[float, float] = (0.0, 0.0)
    """Lean about its y and its x axis [degrees]."""


def _polar(radius: float, angle_deg: float, z: float) -> Size:
    angle = np.radians(angle_deg)
    return float(radius * np.cos(angle)), float(radius * np.sin(angle)), z


def _ring() -> list[Block]:
    """The sarsen ring: eighteen places 20 degrees apart, six of them empty, lintels over neighbours."""
    radius, thickness, width, height, sunk = 0.995, 0.078, 0.145, 0.37, 0.035
    standing = [318, 338, 358, 378, 398, 438, 458, 478, 518, 538, 558, 638]
    top = height - sunk - 0.006
    blocks = []
    for k, angle in enumerate(standing):
        lean = (1.5 * np.sin(5.1 * k), 1.5 * np.cos(3.7 * k))
        width_here = width * (1 + 0.06 * np.sin(2.3 * k))
        blocks.append(Block((thickness, width_here, height), _polar(radius, angle, -sunk), angle, lean))
        if angle + 20 in standing:
            middle = radius * np.cos(np.radians(10))
            chord = 2 * radius * np.sin(np.radians(10))
            blocks.append(Block((thickness + 0.012, chord - 0.006, 0.062), _polar(middle, angle + 10, top), angle + 10))
    return blocks


def _trilithon(radius: float, angle_deg: float, height: float) -> list[Block]:
    """Two uprights and the lintel that they carry."""
    thickness, width, apart, sunk = 0.09, 0.105, 0.098, 0.035
    center, along = np.array(_polar(radius, angle_deg, -sunk)), np.array(_polar(1.0, angle_deg + 90, 0.0))
    feet = [tuple((center + side * along).tolist()) for side in (-apart, apart)]
    return [
        *(Block((thickness, width, height + sunk), foot, angle_deg) for foot in feet),
        Block((thickness + 0.015, 0.315, 0.072), _polar(radius, angle_deg, height - 0.008), angle_deg),
    ]


def _ruins() -> list[Block]:
    """Stones that have fallen, those outside the ring, and the low bluestones."""
    bluestones = [
        (0.72, 8),
        (0.72, 24),
        (0.72, 72),
        (0.72, 346),
        (0.62, 210),
        (0.62, 228),
        (0.61, 246),
        (0.60, 150),
    ]
    low = [
        Block((0.06, 0.07, 0.17 + 0.03 * np.sin(4.0 * k)), _polar(r, angle, -0.03), angle, (4 * np.sin(k), 3.0))
        for k, (r, angle) in enumerate(bluestones)
    ]
    return [
        *low,
        Block((0.34, 0.13, 0.085), (0.77, -0.30, -0.02), 75, (2, 3)),
        Block((0.30, 0.12, 0.080), (-1.09, 0.19, -0.02), 100, (-3, 2)),
        Block((0.26, 0.11, 0.080), (0.02, -0.03, -0.025), -38, (2, 0)),
        Block((0.28, 0.09, 0.070), (0.19, -0.55, -0.022), 20, (2, 4)),
        Block((0.26, 0.12, 0.085), (-0.35, 1.075, -0.02), 15, (3, -4)),
        Block((0.11, 0.13, 0.30), (0.78, 0.92, -0.04), 40, (8, 5)),
        Block((0.10, 0.12, 0.16), (-1.02, -0.42, -0.03), 20, (0, 6)),
        Block((0.10, 0.12, 0.18), (0.62, -1.00, -0.03), -50, (5, 0)),
    ]


def blocks() -> list[Block]:
    """All stones of the place."""
    trilithons = [
        (0.36, 232, 0.52),
        (0.36, 174, 0.46),
        (0.36, 290, 0.46),
        (0.282, 113, 0.41),
        (0.345, 350, 0.41),
    ]
    return [*_ring(), *(block for place_ in trilithons for block in _trilithon(*place_)), *_ruins()]


def build() -> Scene:
    """Raise the stones, lay the meadow, and bake the evening sun."""
    ground, ground_color = meadow(radius=1.27, edge=EDGE)
    parts: list[trimesh.Trimesh] = [ground]
    albedos = [ground_color]
    for seed, block in enumerate(blocks()):
        raised = stone(block.size, EDGE, seed, Roughness())
        tilt = np.radians(block.tilt_deg)
        parts.append(place(raised, block.foot, np.radians(block.yaw_deg), (tilt[0], tilt[1])))
        albedos.append(weathered(parts[-1], seed))
    return Scene(
        name="stonehenge",
        title="Stonehenge",
        mesh=lit(parts, albedos, Light()),
        solids=tuple(parts),
        box=Box.of((-1.3, -1.3, -0.08), (1.3, 1.3, 0.75)),
        sky=(0.72, 0.83, 0.95),
        tasks=TASKS,
    )
