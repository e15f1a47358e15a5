"""The ground of the playground: grass, a pit of sand, and mats of coloured rubber under what one may fall from."""

import numpy as np

from nerfnav_scenes.light import from_srgb
from nerfnav_scenes.noise import fractal, mix, noise, smoothstep
from nerfnav_scenes.parts import Part
from nerfnav_scenes.primitives import box

_THICKNESS = 0.075
_GRASS, _DRY, _CLOVER = (0.42, 0.56, 0.22), (0.64, 0.63, 0.33), (0.24, 0.42, 0.18)
_SAND, _WET = (0.88, 0.76, 0.54), (0.66, 0.52, 0.34)
_MATS = [(0.80, 0.33, 0.20), (0.17, 0.42, 0.62), (0.90, 0.70, 0.25), (0.20, 0.55, 0.50)]
_PIT, _PIT_RADIUS = (0.70, -0.74), 0.47
_MAT_BOX = (-0.80, 0.66, -0.70, 0.86)
"""x and y of the edges of the rubber."""


def lawn(width: float, edge: float) -> Part:
    """A flat square of ground, its top at z = 0."""
    return Part.of(box((width, width, _THICKNESS), edge).apply_translation([0, 0, -_THICKNESS / 2]), _color)


def _color(points: np.ndarray) -> np.ndarray:
    wander = 0.04 * noise(points, 0.25, 300)
    sand = smoothstep(0.02, -0.02, np.hypot(points[:, 0] - _PIT[0], points[:, 1] - _PIT[1]) - _PIT_RADIUS + wander)
    x0, x1, y0, y1 = _MAT_BOX
    x, y = points[:, 0], points[:, 1]
    outside = np.maximum(np.maximum(x0 - x, x - x1), np.maximum(y0 - y, y - y1))
    # the rubber leaves the corner with the pit and an oblong of grass free
    cut = np.minimum(x + 0.16, -0.12 - y)
    rubber = smoothstep(0.012, -0.012, np.maximum(outside, np.minimum(cut, 1)))
    return mix(mix(_grass(points), _rubber(points), rubber), _sand(points), sand)


def _grass(points: np.ndarray) -> np.ndarray:
    color = np.tile(from_srgb(_GRASS), (len(points), 1))
    color = mix(color, from_srgb(_DRY), smoothstep(-0.1, 0.9, fractal(points, 0.28, 301)))
    color = mix(color, from_srgb(_CLOVER), smoothstep(0.0, 0.7, fractal(points, 0.13, 302)))
    daisies = smoothstep(0.25, 0.7, noise(points, 0.4, 303)) * smoothstep(0.45, 0.85, noise(points, 0.034, 304))
    color = mix(color, from_srgb((0.92, 0.9, 0.8)), 0.7 * daisies)
    return color * np.exp(0.28 * noise(points, 0.07, 305) + 0.36 * noise(points, 0.031, 306))[:, None]


def _sand(points: np.ndarray) -> np.ndarray:
    ripples = np.sin(2 * np.pi * (points[:, 0] + 0.5 * points[:, 1] + 0.05 * noise(points, 0.2, 310)) / 0.075)
    color = np.tile(from_srgb(_SAND), (len(points), 1))
    color = mix(color, from_srgb(_WET), smoothstep(0.0, 0.8, fractal(points, 0.18, 311)))
    return color * np.exp(0.12 * ripples + 0.26 * noise(points, 0.06, 312) + 0.28 * noise(points, 0.03, 313))[:, None]


def _rubber(points: np.ndarray) -> np.ndarray:
    """Tiles in four colours with rings on them."""
    size = 0.26
    cell = np.floor(points[:, :2] / size).astype(int)
    middle = (cell + 0.5) * size
    reach = np.hypot(*(points[:, :2] - middle).T)
    own, other = (cell[:, 0] + 2 * cell[:, 1]) % 4, (cell[:, 0] * 3 + cell[:, 1] + 2) % 4
    mats = np.stack([from_srgb(mat) for mat in _MATS])
    circle = smoothstep(0.012, -0.012, np.abs(reach - 0.075) - 0.028)
    seam = smoothstep(0.018, 0.006, 0.5 * size - np.abs(points[:, :2] - middle).max(1))
    color = mix(mats[own], mats[other], 0.85 * circle)
    speckle = 0.24 * noise(points, 0.06, 320) + 0.26 * noise(points, 0.028, 321) + 0.15 * noise(points, 0.2, 322)
    return mix(color * np.exp(speckle)[:, None], from_srgb((0.22, 0.22, 0.24)), 0.6 * seam)
