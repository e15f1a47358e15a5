"""A church without its roof, 2.9 m long in the paper's scale: nave, side aisles, pews, rood screen, altar.

Only the timbers of the roof stand, so that light falls in and cameras can look. The doorway of the rood screen is
20 cm wide: a couch of 30 cm by 10 cm passes only lengthwise, and along the pews only crosswise.
"""

from functools import partial
from itertools import pairwise

import numpy as np

from nerfnav.geometry import Box
from nerfnav.world import Scene
from nerfnav_scenes.finishes import carpet, masonry, paint, painted, stained, striped, tiles, wood
from nerfnav_scenes.light import Color, Light, from_srgb
from nerfnav_scenes.noise import mix, noise, smoothstep
from nerfnav_scenes.parts import Finish, Part, joined, slab
from nerfnav_scenes.primitives import EDGE, Size, bar, box, turned
from nerfnav_scenes.tasks.church import TASKS
from nerfnav_scenes.walls import Opening, Span, Wall, arch, lancet, level, rose

_LONG, _WIDE, _WALL = 1.42, 0.80, 0.07
"""Middles of the outer walls along x and y, and their thickness [m]."""
_EAVES, _RIDGE, _SLOPE = 0.56, 1.06, 0.8
"""Heights [m] and slope of the roof."""
_ARCADE, _COLUMNS = 0.46, (-1.0, -0.6, -0.2, 0.2)
"""Distance of the columns from the axis, and where they stand along it [m]."""
_CAPITAL, _CLERESTORY = 0.34, 0.68
"""Height of the columns and of the wall that they carry [m]."""
_SCREEN, _GAP = 0.58, 0.20
"""Position of the rood screen along x, and width of its doorway [m]."""
_STONE, _WARM, _OAK, _DARK = (0.78, 0.71, 0.60), (0.80, 0.66, 0.50), (0.74, 0.51, 0.30), (0.58, 0.37, 0.22)
_RED, _BLUE, _GOLD, _IVORY = (0.68, 0.12, 0.12), (0.14, 0.26, 0.62), (0.88, 0.68, 0.22), (0.90, 0.85, 0.72)
_GLASS = ((0.86, 0.16, 0.14), (0.16, 0.32, 0.86), (0.98, 0.80, 0.24), (0.16, 0.64, 0.36), (0.62, 0.24, 0.68),
          (0.94, 0.52, 0.14), (0.36, 0.74, 0.92))  # fmt: skip


def build() -> Scene:
    """Raise walls and columns, furnish them, and let the sun in through the southern windows."""
    parts = [_floor(), *_outer_walls(), *_arcades(), *_chancel_arch(), *_screen()]
    parts += [*_pews(), *_chancel(), *_furniture(), *_timbers()]
    # a bright hazy sky: what lies in deep shadow shows a field too little
    light = Light(247, 36, (1.75, 1.42, 1.05), (0.86, 0.87, 0.92), (0.30, 0.27, 0.22), sky_rays=32)
    mesh, solids = joined(parts, light)
    return Scene(
        name="church",
        title="Church",
        mesh=mesh,
        solids=solids,
        box=Box.of((-1.49, -0.87, -0.08), (1.49, 0.87, 1.12)),
        sky=(0.72, 0.83, 0.95),
        tasks=TASKS,
        voxel=0.017,
    )


def _floor() -> Part:
    """Tiles and a runner; the top at z = 0."""

    def finish(points: np.ndarray) -> np.ndarray:
        inside = tiles(points, ((0.72, 0.42, 0.30), (0.84, 0.77, 0.64)), 0.115, 1)
        runner = smoothstep(0.098, 0.092, np.abs(points[:, 1]))
        return mix(inside, carpet(points, _RED, 0.095, 2), runner)

    floor = box((2.93, 1.69, 0.07), EDGE)
    return Part.of(floor.apply_translation([0, 0, -0.035]), finish)


def _gable(x: np.ndarray) -> np.ndarray:
    return np.maximum(_EAVES, _RIDGE - _SLOPE * np.abs(x))


def _glazed(wall: Wall, seed: int) -> list[Part]:
    """A wall and its stained glass, two voxels thick."""
    finish = partial(masonry, color=_STONE, seed=seed)
    return [wall.stones(finish, EDGE), *wall.panes(partial(stained, colors=_GLASS, seed=seed), 0.03, EDGE)]


def _outer_walls() -> list[Part]:
    windows = dict(lancet(x, 0.17, 0.16, 0.34) for x in (-1.2, -0.8, -0.4, 0.0, 0.4, 0.98))
    side = Wall((-_LONG + 0.034, _LONG - 0.034), _WALL, -0.03, level(_EAVES), windows)
    half = _WIDE + _WALL / 2
    door: Span = (-0.15, 0.15)
    west: dict[Span, list[Opening]] = {door: [Opening(level(-0.1), arch(door, 0.20)), rose(0, 0.68, 0.15)]}
    springs = {-0.6: 0.34, -0.21: 0.50, 0.0: 0.62, 0.21: 0.50, 0.6: 0.34}
    east = dict(lancet(y, 0.14, 0.25, spring) for y, spring in springs.items())
    ends = [Wall((-half, half), _WALL, -0.03, _gable, openings) for openings in (west, east)]
    walls = [
        (side, (0.0, -_WIDE, 0.0), 0.0),
        (side, (0.0, _WIDE, 0.0), 0.0),
        (ends[0], (-_LONG, 0.0, 0.0), np.pi / 2),
        (ends[1], (_LONG, 0.0, 0.0), np.pi / 2),
    ]
    return [
        part.placed(foot, yaw) for seed, (wall, foot, yaw) in enumerate(walls) for part in _glazed(wall, seed)
    ]


def _arcades() -> list[Part]:
    """Columns on either side of the nave, and the arches that they carry."""

    def radius(z: np.ndarray) -> np.ndarray:
        base, capital = smoothstep(0.075, 0.045, z), smoothstep(_CAPITAL - 0.075, _CAPITAL - 0.01, z)
        return 0.042 + 0.018 * base + 0.022 * capital

    stops = (-_LONG, *_COLUMNS, _SCREEN)
    spans = [(a + 0.04, b - 0.04) for a, b in pairwise(stops)]
    bays: dict[Span, list[Opening]] = {span: [Opening(level(0), arch(span, _CAPITAL, 0.6))] for span in spans}
    wall = Wall((-_LONG + 0.034, _SCREEN), 0.06, _CAPITAL - 0.002, level(_CLERESTORY), bays)
    arches = wall.stones(partial(masonry, color=_WARM, seed=5, course=0.06), EDGE)
    parts = []
    for side in (-1, 1):
        parts.append(arches.placed((0, side * _ARCADE, 0)))
        for k, x in enumerate(_COLUMNS):
            column = Part.of(turned(_CAPITAL + 0.03, radius, 0.012), _marble(k + side))
            parts.append(column.placed((x, side * _ARCADE, -0.03)))
    return parts


def _marble(seed: int) -> Finish:
    def finish(points: np.ndarray) -> np.ndarray:
        veins = np.sin(26 * (points[:, 2] + 0.09 * noise(points + seed, 0.11, 410)) + 9 * points[:, 0])
        vein = smoothstep(0.1, 0.9, veins)
        return mix(painted(points, _IVORY, 410 + seed), from_srgb((0.55, 0.33, 0.26)), 0.7 * vein)

    return finish


def _chancel_arch() -> list[Part]:
    """The wall between nave and chancel, open in the middle, and lower walls that close the aisles."""
    span: Span = (-0.36, 0.36)
    wall = Wall((-0.50, 0.50), _WALL, -0.03, _gable, {span: [Opening(level(-0.1), arch(span, 0.42, 0.58))]})
    closing = Wall((0.49, _WIDE), _WALL, -0.03, level(0.50), {})
    stones = wall.stones(partial(masonry, color=_STONE, seed=7, course=0.065), EDGE)
    left, right = (closing.stones(partial(masonry, color=_WARM, seed=seed), EDGE) for seed in (8, 9))
    return [
        stones.placed((_SCREEN, 0, 0), np.pi / 2),
        left.placed((_SCREEN, 0, 0), np.pi / 2),
        right.placed((_SCREEN, 0, 0), -np.pi / 2),
    ]


def _screen() -> list[Part]:
    """The rood screen: oak panels on either side of the narrow doorway, bars above them, a beam, a cross."""
    width = 0.37 - _GAP / 2
    parts = []
    for side in (-1, 1):
        boards = slab((width, 0.09, 0.33), partial(_panelled, seed=420 + side))
        parts.append(boards.placed((_SCREEN, side * (_GAP / 2 + width / 2), 0.135), np.pi / 2))
        for k, y in enumerate((0.12, 0.20, 0.28)):
            parts.append(_timber((_SCREEN, side * y, 0.29), (_SCREEN, side * y, 0.47), _DARK, 425 + k))
    beam = slab((0.74, 0.06, 0.05), partial(striped, colors=(_RED, _GOLD), width=0.06, seed=430))
    return [
        *parts,
        beam.placed((_SCREEN, 0, 0.48), np.pi / 2),
        slab((0.04, 0.04, 0.20), paint(_GOLD, 431)).placed((_SCREEN, 0, 0.60)),
        slab((0.04, 0.14, 0.04), paint(_GOLD, 432)).placed((_SCREEN, 0, 0.635)),
    ]


def _panelled(points: np.ndarray, seed: int) -> np.ndarray:
    """Oak with painted fields."""
    across, up = np.abs((points[:, 0] / 0.088) % 1 - 0.5), np.abs(points[:, 2] / 0.33)
    field = smoothstep(0.36, 0.30, across) * smoothstep(0.40, 0.34, up)
    color = np.where((np.floor(points[:, 0] / 0.088) % 2 == 0)[:, None], from_srgb(_BLUE), from_srgb(_RED))
    stars = smoothstep(0.35, 0.7, noise(points + seed, 0.04, 433))
    return mix(wood(points, _OAK, seed, axis=2), mix(1.2 * color, from_srgb(_GOLD), 0.7 * stars), 0.9 * field)


def _timber(start: Size, end: Size, color: Color, seed: int) -> Part:
    return Part.of(bar(start, end, 0.021, 0.012), partial(wood, color=color, seed=seed))


def _pews() -> list[Part]:
    """Three rows on either side of the runner, each with a painted end."""
    parts = []
    for k, x in enumerate(_COLUMNS[:3]):
        for side in (-1, 1):
            y, seed = side * 0.255, 440 + 2 * k + side
            seat = slab((0.11, 0.25, 0.13), partial(wood, color=_OAK, seed=seed, axis=1))
            back = slab((0.045, 0.25, 0.24), partial(wood, color=_DARK, seed=seed + 7, axis=1))
            end = slab((0.165, 0.04, 0.20), partial(_panelled, seed=seed))
            parts += [seat.placed((x + 0.075, y, 0.035)), back.placed((x, y, 0.09))]
            parts.append(end.placed((x + 0.055, side * 0.146, 0.07)))
    return parts


def _chancel() -> list[Part]:
    """A step, the altar with cloth and candles, stalls along the sides."""
    step = slab((0.36, 0.92, 0.065), partial(tiles, colors=((0.30, 0.36, 0.42), _IVORY), size=0.09, seed=3))
    altar = slab((0.15, 0.42, 0.18), partial(striped, colors=(_IVORY, _RED), width=0.05, seed=450))
    top = slab((0.17, 0.45, 0.04), paint(_IVORY, 451))
    parts = [step.placed((1.21, 0, 0.0025)), altar.placed((1.24, 0, 0.10)), top.placed((1.24, 0, 0.20))]
    for side in (-1, 1):
        candle = bar((1.27, 0.15 * side, 0.2), (1.27, 0.15 * side, 0.33), 0.021, 0.012)
        parts.append(Part.of(candle, paint(_GOLD, 452)))
        stall = slab((0.32, 0.10, 0.17), partial(wood, color=_OAK, seed=455 + side))
        back = slab((0.32, 0.045, 0.32), partial(_panelled, seed=457 + side))
        parts += [stall.placed((0.86, 0.68 * side, 0.055)), back.placed((0.86, 0.735 * side, 0.13))]
    return parts


def _furniture() -> list[Part]:
    """A font in the west, a pulpit in the east, a chest, banners on the aisles' walls."""

    def cup(z: np.ndarray) -> np.ndarray:
        return 0.05 + 0.035 * smoothstep(0.10, 0.16, z) + 0.025 * smoothstep(0.06, 0.03, z)

    font = Part.of(turned(0.21, cup, 0.012), paint((0.62, 0.66, 0.66), 460))
    pulpit = Part.of(turned(0.30, lambda z: 0.045 + 0.04 * smoothstep(0.13, 0.19, z), 0.012), paint(_GOLD, 461))
    chest = slab((0.24, 0.11, 0.14), partial(_panelled, seed=462))
    parts = [font.placed((-1.20, -0.30, -0.03)), pulpit.placed((0.44, -0.30, -0.03)), chest.placed((-1.2, 0.70, 0.04))]
    for k, (x, side) in enumerate([(-0.6, -1), (-0.2, 1), (0.2, -1), (-1.0, 1), (0.2, 1), (-1.0, -1)]):
        colors = ((_RED, _GOLD), (_BLUE, _IVORY))[k % 2]
        cloth = slab((0.13, 0.03, 0.26), partial(striped, colors=colors, width=0.035, seed=470 + k))
        parts.append(cloth.placed((x, side * (_WIDE - 0.045), 0.36)))
    return parts


def _timbers() -> list[Part]:
    """Remains of the roof: ties and rafters over the nave and the chancel, lean-to rafters over the aisles."""
    parts = [_timber((-_LONG, 0, _RIDGE - 0.03), (_LONG, 0, _RIDGE - 0.03), _DARK, 480)]
    for k, x in enumerate((*_COLUMNS, 1.0)):
        reach, foot = (_ARCADE, _CLERESTORY) if x < _SCREEN else (_WIDE, _EAVES)
        parts.append(_timber((x, -reach, foot + 0.01), (x, reach, foot + 0.01), _OAK, 481 + k))
        for side in (-1, 1):
            parts.append(_timber((x, side * reach, foot), (x, 0, _RIDGE - 0.02), _DARK, 486 + k))
            if x < _SCREEN:
                low, high = (x, side * _WIDE, _EAVES), (x, side * _ARCADE, _CLERESTORY - 0.02)
                parts.append(_timber(low, high, _OAK, 491 + k))
    return parts
