"""Furniture of its true size: each piece stands on z = 0 around the origin, its front towards +x.

Legs are as thin as legs are: 3 cm, less than a voxel of a place of that size.
"""

from collections.abc import Sequence
from functools import partial

import numpy as np

from nerfnav_scenes.finishes import painted, striped, wood
from nerfnav_scenes.light import Color, from_srgb
from nerfnav_scenes.parts import Finish, Part
from nerfnav_scenes.primitives import Roughness, Size, bar, box, stone, turned

_FINE = 0.04
"""Legs of the triangles of what has a pattern [m]."""
_GRAIN = 2.5
"""Factor by which patterns are coarser than in the paper's scale, which the finishes are made for."""
_LEG = 0.03
"""Thickness of legs [m]."""
_CORNERS = ((-1, -1), (-1, 1), (1, -1), (1, 1))


def plain(color: Color) -> Finish:
    """Paint without any pattern."""
    return lambda points: np.tile(from_srgb(color), (len(points), 1))


def coarse(finish: Finish) -> Finish:
    """A finish with its pattern as large as furniture asks for."""
    return lambda points: finish(points / _GRAIN)


def timber(color: Color, seed: int, axis: int = 0) -> Finish:
    """Wood with its grain along an axis."""
    return coarse(partial(wood, color=color, seed=seed, axis=axis))


def cloth(color: Color, seed: int) -> Finish:
    """Finish of worn fabric."""
    return coarse(partial(painted, color=color, seed=seed))


def block(size: Size, bottom: Size, finish: Finish) -> Part:
    """A box of `size` [m] whose underside has its middle at `bottom`."""
    x, y, z = bottom
    return Part.of(box(size, _FINE), finish).placed((x, y, z + size[2] / 2))


def placed(parts: Sequence[Part], position: Size, yaw: float = 0.0) -> list[Part]:
    """All parts of a piece turned about z [rad] and moved [m]."""
    return [part.placed(position, yaw) for part in parts]


def table(size: Size, color: Color, seed: int) -> list[Part]:
    """A top of 4 cm on four thin legs; `size` is that of the whole [m]."""
    long, wide, high = size
    top = block((long, wide, 0.04), (0, 0, high - 0.04), timber(color, seed))
    return [top, *_legs(long, wide, high - 0.03, color, seed + 1)]


def chair(color: Color, seed: int) -> list[Part]:
    """Four thin legs, a seat, and a back at -x."""
    seat = block((0.42, 0.42, 0.04), (0, 0, 0.43), cloth(color, seed))
    back = block((0.04, 0.42, 0.28), (-0.19, 0, 0.64), cloth(color, seed))
    posts = [_post((-0.19, side * 0.185, 0.46), 0.30, color, seed) for side in (-1, 1)]
    return [seat, back, *_legs(0.42, 0.42, 0.44, color, seed), *posts]


def _legs(long: float, wide: float, high: float, color: Color, seed: int) -> list[Part]:
    """Four legs under a rectangle."""
    x, y = long / 2 - 0.03, wide / 2 - 0.03
    return [_post((i * x, j * y, 0), high, color, seed) for i, j in _CORNERS]


def _post(foot: Size, high: float, color: Color, seed: int) -> Part:
    return Part.of(box((_LEG, _LEG, high), _FINE), timber(color, seed, 2)).placed((*foot[:2], foot[2] + high / 2))


def settee(wide: float, color: Color, seed: int) -> list[Part]:
    """A couch for people to sit on, its back at -x, with two cushions."""
    parts = [
        block((0.85, wide, 0.38), (0, 0, 0.04), cloth(color, seed)),
        block((0.22, wide, 0.42), (-0.315, 0, 0.40), cloth(color, seed)),
    ]
    for side in (-1, 1):
        parts.append(block((0.85, 0.16, 0.20), (0, side * (wide / 2 - 0.08), 0.40), cloth(color, seed)))
        pillow = stone((0.42, 0.14, 0.40), _FINE, seed, Roughness(rounding=0.05, taper=0, bulge=0, grain=0))
        finish = coarse(partial(striped, colors=((0.93, 0.72, 0.25), (0.92, 0.90, 0.84)), width=0.03, seed=seed))
        parts.append(Part.of(pillow, finish).placed((-0.10, side * (wide / 2 - 0.45), 0.39), np.pi / 2, (0.0, -0.3)))
    return parts


def bed(size: Size, color: Color, seed: int) -> list[Part]:
    """A bed with its head at +x: frame on four feet, mattress, blanket, pillows."""
    long, wide, high = size
    frame = block((long, wide, 0.14), (0, 0, 0.16), timber((0.62, 0.43, 0.27), seed))
    head = block((0.06, wide, 0.95), (long / 2 - 0.03, 0, 0), timber((0.62, 0.43, 0.27), seed, 1))
    mattress = block((long - 0.1, wide - 0.08, high - 0.28), (-0.02, 0, 0.28), plain((0.93, 0.92, 0.90)))
    stripes = coarse(partial(striped, colors=(color, (0.93, 0.90, 0.84)), width=0.09, seed=seed))
    blanket = block((0.62 * long, wide + 0.02, 0.18), (-0.18 * long, 0, high - 0.15), stripes)
    pillows = [
        block((0.38, 0.55, 0.12), (long / 2 - 0.30, side * wide / 4, high - 0.02), cloth(color, seed + side))
        for side in (-1, 1)
    ]
    return [frame, head, mattress, blanket, *_legs(long - 0.1, wide, 0.18, color, seed), *pillows]


def bookcase(size: Size, color: Color, seed: int) -> list[Part]:
    """Open shelves towards +x, with books of all colours in them; `size` is that of the whole [m]."""
    deep, wide, high = size
    back = block((0.03, wide, high), (-deep / 2 + 0.015, 0, 0), timber(color, seed, 1))
    parts = [back, *(block((deep, 0.04, high), (0, s * (wide / 2 - 0.02), 0), timber(color, seed, 2)) for s in (-1, 1))]
    shelves = round(high / 0.38)
    random = np.random.default_rng(seed)
    for k in range(shelves + 1):
        z = k * (high - 0.04) / shelves
        parts.append(block((deep, wide, 0.04), (0, 0, z), timber(color, seed + k, 1)))
        if k < shelves:
            row = random.uniform(0.45, 0.85) * (wide - 0.1)
            shift = random.uniform(-1, 1) * (wide - 0.1 - row) / 2
            parts.append(block((0.7 * deep, row, 0.25), (-0.03, shift, z + 0.03), partial(_books, seed=seed + k)))
    return parts


def _books(points: np.ndarray, seed: int) -> np.ndarray:
    """Backs of books, about 6 cm thick, side by side along y."""
    table = from_srgb(np.random.default_rng(seed).uniform(0.15, 0.9, (97, 3)))  # type: ignore[arg-type] # a whole list
    return table[np.floor(points[:, 1] / 0.06).astype(int) % len(table)]


def cupboard(size: Size, color: Color, seed: int) -> list[Part]:
    """A closed box with a plain front, and a grip."""
    deep, _, high = size
    grip = block((0.03, 0.03, min(0.2, high / 3)), (deep / 2 + 0.012, 0, 0.5 * high), plain((0.25, 0.25, 0.27)))
    return [block(size, (0, 0, 0), plain(color)), grip]


def hanging_lamp(drop: float, color: Color, seed: int) -> list[Part]:
    """A shade below a wire of 1.2 cm, `drop` [m] long, which hangs from the origin."""
    shade = turned(0.24, lambda z: 0.22 - 0.66 * z, 0.03)
    wire = bar((0, 0, -drop), (0, 0, 0.02), 0.006, 0.06)
    return [Part.of(wire, plain((0.12, 0.12, 0.13))), Part.of(shade, cloth(color, seed)).placed((0, 0, -drop - 0.20))]


def standing_lamp(high: float, color: Color, seed: int) -> list[Part]:
    """A foot, a thin pole, a shade."""
    foot, pole = turned(0.03, lambda z: 0.15 + 0 * z, 0.03), bar((0, 0, 0.01), (0, 0, high - 0.05), 0.015, 0.03)
    shade = turned(0.30, lambda z: 0.20 - 0.25 * z, 0.03)
    metal = plain((0.30, 0.30, 0.32))
    return [Part.of(foot, metal), Part.of(pole, metal), Part.of(shade, cloth(color, seed)).placed((0, 0, high - 0.30))]


def plant(high: float, seed: int) -> list[Part]:
    """A pot, a stem, leaves in balls."""
    pot = Part.of(turned(0.34, lambda z: 0.13 + 0.15 * z, 0.03), cloth((0.76, 0.42, 0.28), seed))
    stem = Part.of(bar((0, 0, 0.30), (0, 0, high - 0.1), 0.02, 0.03), timber((0.42, 0.30, 0.20), seed, 2))
    parts = [pot, stem]
    for k, (x, y, z) in enumerate([(0.10, 0.02, 0.55), (-0.08, 0.10, 0.7), (-0.05, -0.11, 0.82), (0.03, 0.0, 1.0)]):
        size = 0.34 - 0.03 * k
        ball = stone((size, size, 0.8 * size), 0.03, seed + k, Roughness(0.5 * size, 0.1, 0.03, 0.008))
        parts.append(Part.of(ball, cloth((0.27, 0.46, 0.20), seed + k)).placed((x, y, z * high - 0.8 * size)))
    return parts


def picture(wide: float, high: float, colors: tuple[Color, Color, Color], seed: int) -> list[Part]:
    """A painting in a frame, its back at x = 0."""

    def strokes(points: np.ndarray) -> np.ndarray:
        sky, sea, sun = (painted(points / _GRAIN, color, seed + k) for k, color in enumerate(colors))
        below = points[:, 2] < -0.1 * high + 0.06 * np.sin(9 * points[:, 1] + seed)
        disk = np.hypot(points[:, 1] - 0.18 * wide, points[:, 2] - 0.18 * high) < 0.2 * high
        return np.where(below[:, None], sea, np.where(disk[:, None], sun, sky))

    canvas = Part.of(box((0.04, wide, high), 0.02), strokes).placed((0.02, 0, 0))
    frame = timber((0.35, 0.22, 0.14), seed)
    rails = [block((0.05, wide + 0.08, 0.04), (0.025, 0, z), frame) for z in (-high / 2 - 0.04, high / 2)]
    sides = [block((0.05, 0.04, high), (0.025, s * (wide / 2 + 0.02), -high / 2), frame) for s in (-1, 1)]
    return [canvas, *rails, *sides]
