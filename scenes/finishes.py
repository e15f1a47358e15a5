"""Finishes of surfaces: functions from points on them to linear colours, rich from 20 cm down to 2.5 cm.

Patterns are laid out in a part's own frame, before it is placed, with its length along x unless said otherwise.
"""

from functools import partial

import numpy as np

from nerfnav_scenes.light import Color, from_srgb
from nerfnav_scenes.noise import fractal, mix, noise, smoothstep
from nerfnav_scenes.parts import Finish

_MORTAR, _GOLD, _RUST = (0.80, 0.77, 0.70), (0.86, 0.70, 0.30), (0.45, 0.27, 0.17)


def painted(points: np.ndarray, color: Color, seed: int) -> np.ndarray:
    """Paint that sun and hands have worn unevenly: linear colours (n, 3) of points (n, 3)."""
    own = points + 2.7 * seed
    shade = 0.18 * noise(own, 0.15, 200) + 0.22 * noise(own, 0.05, 201) + 0.16 * noise(own, 0.026, 202)
    worn = smoothstep(0.45, 0.9, fractal(own, 0.06, 203))
    base = np.tile(from_srgb(color), (len(points), 1)) * np.exp(shade)[:, None]
    return mix(base, 0.45 * from_srgb(color) + 0.4, 0.6 * worn)


def paint(color: Color, seed: int) -> Finish:
    """One coat of `painted`."""
    return partial(painted, color=color, seed=seed)


def striped(points: np.ndarray, colors: tuple[Color, Color], width: float, seed: int) -> np.ndarray:
    """Bands of two paints, each `width` [m] along x."""
    band = smoothstep(-0.35, 0.35, np.sin(np.pi * points[:, 0] / width))
    return mix(painted(points, colors[0], seed), painted(points, colors[1], seed + 1), band)


def wood(points: np.ndarray, color: Color, seed: int, axis: int = 0) -> np.ndarray:
    """Planks whose grain runs along an axis, with a few knots."""
    stretch = np.ones(3)
    stretch[axis] = 0.16
    own = points + 1.9 * seed
    grain = 0.36 * noise(own * stretch, 0.030, 210) + 0.28 * noise(own * stretch, 0.06, 211)
    grain += 0.18 * noise(own, 0.03, 214)
    knots = smoothstep(0.72, 0.95, noise(own * (0.4 + 0.6 * stretch), 0.07, 212))
    tone = np.exp(grain + 0.2 * noise(own, 0.2, 213))[:, None]
    return mix(from_srgb(color) * tone, 0.3 * from_srgb(color), 0.7 * knots)


def masonry(points: np.ndarray, color: Color, seed: int, course: float = 0.075) -> np.ndarray:
    """Hewn blocks in courses: along x + y and z; every block has a hue of its own."""
    row = np.floor(points[:, 2] / course)
    along = (points[:, 0] + points[:, 1]) / (1.9 * course) + 0.5 * (row % 2) + 0.17 * np.sin(2.1 * row)
    block = np.floor(along)
    own = np.stack([block, row, np.full_like(row, seed)], -1) * 0.377
    tone = np.stack([0.20 * noise(own, 0.31, 220) + 0.09 * noise(own, 0.29, 221 + k) for k in range(3)], -1)
    spots = 0.20 * noise(points + seed, 0.08, 225) + 0.30 * noise(points + seed, 0.03, 226)
    base = from_srgb(color) * np.exp(1.8 * tone + spots[:, None])
    from_joint = np.minimum(
        np.minimum(along - block, block + 1 - along) * 1.9, 0.5 - np.abs((points[:, 2] / course) % 1 - 0.5)
    )
    joint = smoothstep(0.13, 0.05, from_joint)
    stain = smoothstep(0.3, 0.85, fractal(points + seed, 0.16, 227))
    return mix(mix(base, from_srgb(_MORTAR), 0.45 * joint), from_srgb(_RUST) * 1.3, 0.28 * stain)


def tiles(points: np.ndarray, colors: tuple[Color, Color], size: float, seed: int) -> np.ndarray:
    """A chequered floor of tiles of `size` [m], no two of them quite alike."""
    cell = np.floor(points[:, :2] / size)
    share = smoothstep(-0.06, 0.06, np.prod(np.sin(np.pi * points[:, :2] / size), axis=1))
    own = np.concatenate([cell, np.full((len(points), 1), seed)], -1) * 0.377
    tone = np.stack([0.20 * noise(own, 0.30, 230) + 0.10 * noise(own, 0.27, 231 + k) for k in range(3)], -1)
    veins = 0.28 * fractal(points + seed, 0.07, 235) + 0.28 * noise(points + seed, 0.028, 236)
    base = mix(np.tile(from_srgb(colors[0]), (len(points), 1)), from_srgb(colors[1]), share)
    return base * np.exp(tone + veins[:, None])


def carpet(points: np.ndarray, color: Color, half_width: float, seed: int) -> np.ndarray:
    """A runner along x with golden borders and medallions."""
    across = np.abs(points[:, 1]) / half_width
    medallion = np.cos(2 * np.pi * points[:, 0] / 0.16) * np.cos(np.pi * across)
    gold = np.maximum(smoothstep(0.06, 0.02, np.abs(across - 0.8)), smoothstep(0.45, 0.7, medallion))
    return mix(painted(points, color, seed), from_srgb(_GOLD), 0.85 * gold)


def stained(points: np.ndarray, colors: tuple[Color, ...], seed: int) -> np.ndarray:
    """Coloured glass in lead: cells of a Voronoi pattern in the plane of x and z, bright with light behind them."""
    cell = 0.065
    table = np.random.default_rng(seed).uniform(0, 1, (24, 24, 3))
    flat = points[:, [0, 2]] / cell
    base = np.floor(flat)
    nearest, second = np.full(len(flat), np.inf), np.full(len(flat), np.inf)
    choice = np.zeros(len(flat), int)
    for shift in np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1]), -1).reshape(-1, 2):
        corner = base + shift
        key = table[tuple(corner.astype(int).T % len(table))]
        center = corner + 0.5 + 0.35 * (2 * key[:, :2] - 1)
        distance = np.linalg.norm(flat - center, axis=-1)
        closer = distance < nearest
        second = np.where(closer, nearest, np.minimum(second, distance))
        choice = np.where(closer, (key[:, 2] * len(colors)).astype(int), choice)
        nearest = np.where(closer, distance, nearest)
    lead = smoothstep(0.22, 0.10, second - nearest)
    glow = np.exp(0.25 * noise(points + seed, 0.05, 240))[:, None]
    shades = np.stack([from_srgb(color) for color in colors])
    return mix(shades[choice] * glow, from_srgb((0.2, 0.19, 0.2)), 0.75 * lead)
