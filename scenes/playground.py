"""A playground, 2.4 m across in the paper's scale: two towers, a tube, a slide, monkey bars and a jungle gym.

Bars are 4 cm thick, so that voxels can learn them; a quadrotor fits through the tube, under the monkey bars, and
through the cells of the jungle gym.
"""

from functools import partial

import numpy as np

from nerfnav.geometry import Box
from nerfnav.world import Scene
from nerfnav_scenes.finishes import paint, striped, wood
from nerfnav_scenes.lawn import lawn
from nerfnav_scenes.light import Color, Light
from nerfnav_scenes.parts import Part, joined, slab
from nerfnav_scenes.primitives import EDGE, Roughness, Size, bar, panel, ring, stone, turned
from nerfnav_scenes.tasks.playground import TASKS

_FINE = 0.011
"""Legs of the triangles of bars [m]."""
_BAR = 0.02
"""Radius of bars [m]."""
_DECK = 0.40
"""Height of the platforms [m]."""
_HALF = 0.21
"""Half the distance of a tower's posts [m]."""
_A, _B = (-0.50, 0.55), (0.36, 0.55)
"""Positions of the towers [m]."""
_RED, _BLUE, _YELLOW, _GREEN = (0.84, 0.20, 0.17), (0.14, 0.38, 0.74), (0.95, 0.74, 0.16), (0.30, 0.62, 0.26)
_ORANGE, _TEAL, _PLUM, _WHITE = (0.93, 0.47, 0.13), (0.12, 0.60, 0.62), (0.52, 0.25, 0.55), (0.90, 0.88, 0.82)
_TIMBER, _RUBBER, _LEAF = (0.68, 0.46, 0.26), (0.25, 0.24, 0.25), (0.29, 0.46, 0.17)
_STUMPS = ((-0.98, -0.18, 0.10), (-1.06, -0.36, 0.16), (-0.95, -0.54, 0.22))
_BUSHES = ((-1.08, 1.06, 0.24), (-0.84, 1.12, 0.17), (1.05, 1.05, 0.26), (-0.06, 1.1, 0.2))
"""Of each its x, y and height or width [m]."""


def build() -> Scene:
    """Put everything on the lawn and light it."""
    parts = [lawn(2.44, EDGE), *_towers(), *_tube(), *_slide(), *_monkey_bars(), *_jungle_gym(), *_odds_and_ends()]
    mesh, solids = joined(parts, Light(azimuth_deg=228, elevation_deg=41))
    return Scene(
        name="playground",
        title="Playground",
        mesh=mesh,
        solids=solids,
        box=Box.of((-1.25, -1.25, -0.08), (1.25, 1.25, 1.12)),
        sky=(0.70, 0.83, 0.96),
        tasks=TASKS,
        voxel=0.0145,
    )


def _bar(start: Size, end: Size, color: Color, seed: int) -> Part:
    return Part.of(bar(start, end, _BAR, _FINE), paint(color, seed))


def _towers() -> list[Part]:
    """Decks on four posts; the left one has a roof, the right one a climbing wall."""
    parts = []
    for k, ((x, y), top, color) in enumerate([(_A, 0.86, _BLUE), (_B, 0.62, _RED)]):
        for side_x in (-_HALF, _HALF):
            for side_y in (-_HALF, _HALF):
                foot = (x + side_x, y + side_y, -0.03)
                parts.append(_bar(foot, (foot[0], foot[1], top), color, 10 * k + len(parts)))
        deck = slab((2 * _HALF + 0.05, 2 * _HALF + 0.05, 0.04), partial(wood, color=_TIMBER, seed=k))
        rail = slab((2 * _HALF, 0.04, 0.15), partial(striped, colors=(_YELLOW, _GREEN), width=0.07, seed=20 + k))
        parts += [deck.placed((x, y, _DECK - 0.02)), rail.placed((x, y + _HALF, _DECK + 0.115))]
    return [*parts, *_roof(), *_climbing_wall(), *_ladder((_A[0] - _HALF, _A[1]), (-0.2, 0.0), _DECK + 0.02)]


def _roof() -> list[Part]:
    x, y = _A
    gable = panel((-0.235, 0.235), 0.04, lambda x: 0 * x, lambda x: 0.025 + 0.13 * (1 - np.abs(x) / 0.235), EDGE)
    sheet = slab((0.33, 0.52, 0.04), partial(striped, colors=(_RED, _ORANGE), width=0.06, seed=33))
    return [
        *(Part.of(gable, paint(_YELLOW, 31)).placed((x, y + side, 0.84)) for side in (-_HALF, _HALF)),
        *(sheet.placed((x + 0.125 * side, y, 0.935), 0, (0.52 * side, 0.0)) for side in (-1, 1)),
    ]


def _climbing_wall() -> list[Part]:
    """A leaning wall on the right of the right tower, with holds."""
    x, y = _B
    wall = slab((0.05, 0.40, 0.46), partial(wood, color=(0.82, 0.66, 0.44), seed=4, axis=1))
    lean = 0.20
    parts = [wall.placed((x + _HALF + 0.06, y, 0.20), 0, (-lean, 0.0))]
    colors = [_RED, _TEAL, _YELLOW, _PLUM, _GREEN, _ORANGE, _BLUE, _RED, _TEAL]
    for k, color in enumerate(colors):
        up, along = 0.07 + 0.125 * (k // 3), 0.13 * (k % 3 - 1) + 0.03 * (-1) ** (k // 3)
        hold = stone((0.05, 0.05, 0.05), 0.01, 40 + k, Roughness(rounding=0.03, bulge=0.004))
        place_ = (x + _HALF + 0.06 + 0.03 + np.tan(lean) * (0.20 - up), y + along, up - 0.025)
        parts.append(Part.of(hold, paint(color, 50 + k)).placed(place_))
    return parts


def _ladder(head: tuple[float, float], lean: tuple[float, float], height: float) -> list[Part]:
    """Two rails and rungs from the ground up to `head`, its foot shifted by `lean` [m]."""
    across = np.array([-lean[1], lean[0]]) / np.hypot(*lean) * 0.11

    def at(share: float, side: float) -> Size:
        x, y = np.array(head) + (1 - share) * np.array(lean) + side * across
        return float(x), float(y), height * share

    shares = [0.2 + 0.24 * k for k in range(4)]
    return [
        *(_bar(at(-0.06, side), at(1.25, side), _GREEN, 60) for side in (-1.0, 1.0)),
        *(_bar(at(share, -1.0), at(share, 1.0), _YELLOW, seed) for seed, share in enumerate(shares, 62)),
    ]


def _tube() -> list[Part]:
    """The tunnel from tower to tower: 28 cm wide inside."""
    inner, outer, length = 0.145, 0.185, _B[0] - _A[0] - 2 * _HALF + 0.06
    profile = np.array([[inner, 0], [outer, 0], [outer, length], [inner, length]])
    tube = ring(profile, EDGE)
    tube.apply_transform([[0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
    part = Part.of(tube, partial(striped, colors=(_TEAL, _BLUE), width=0.13, seed=70))
    return [part.placed((_A[0] + _HALF - 0.03, _A[1], _DECK + outer - 0.015))]


def _slide() -> list[Part]:
    """A chute from the right tower down to the south."""
    length, width = 0.80, 0.24

    def height(run: np.ndarray) -> np.ndarray:
        share = np.clip(run / length, 0, 1)
        return 0.035 + (_DECK - 0.045) * (0.5 + 0.5 * np.cos(np.pi * share**0.85))

    bed = panel((0, length), width, lambda s: height(s) - 0.04, height, EDGE)
    lip = panel((0, length), 0.04, lambda s: height(s) - 0.045, lambda s: height(s) + 0.06, EDGE)
    parts = [Part.of(bed, partial(striped, colors=(_YELLOW, _ORANGE), width=0.2, seed=80))]
    parts += [Part.of(lip, paint(_RED, 82)).placed((0, side * width / 2, 0)) for side in (-1, 1)]
    return [
        *(part.placed((_B[0], _B[1] - _HALF + 0.01, 0), -np.pi / 2) for part in parts),
        *(_bar((_B[0] + s, 0.0, -0.03), (_B[0] + s, 0.0, 0.19), _RED, 84) for s in (-0.09, 0.09)),
    ]


def _monkey_bars() -> list[Part]:
    """From the left tower to the south, 62 cm above the ground."""
    x, north, south, top = _A[0], _A[1] - _HALF, -0.62, 0.62
    parts = []
    for side in (-0.17, 0.17):
        parts.append(_bar((x + side, south - 0.02, top), (x + side, north, top), _PLUM, 90))
        parts.append(_bar((x + side, south, -0.03), (x + side, south, top), _PLUM, 92))
    parts.append(_bar((x - _HALF, north, top), (x + _HALF, north, top), _BLUE, 93))
    for k in range(5):
        y = south + 0.10 + 0.175 * k
        parts.append(_bar((x - 0.19, y, top), (x + 0.19, y, top), (_YELLOW, _ORANGE)[k % 2], 94 + k))
    rungs = [_bar((x - 0.17, south, z), (x + 0.17, south, z), _TEAL, 100) for z in (0.13, 0.27, 0.41)]
    return parts + rungs


def _jungle_gym() -> list[Part]:
    """Two by two by two cells of 26 cm, and a cell on top."""
    x0, y0, cell = 0.44, -1.00, 0.26
    colors = (_RED, _BLUE, _YELLOW)
    parts = []
    for i in range(3):
        for j in range(3):
            x, y = x0 + cell * i, y0 + cell * j
            top = 3 * cell if i < 2 and j < 2 else 2 * cell
            parts.append(_bar((x, y, -0.03), (x, y, top + _BAR), colors[2], 110 + i))
    for level in (1, 2):
        for k in range(3):
            x, y, z = x0 + cell * k, y0 + cell * k, cell * level
            parts.append(_bar((x, y0 - _BAR, z), (x, y0 + 2 * cell + _BAR, z), colors[0], 113 + k))
            parts.append(_bar((x0 - _BAR, y, z), (x0 + 2 * cell + _BAR, y, z), colors[1], 116 + k))
    for k in range(2):
        x, y, z = x0 + cell * k, y0 + cell * k, 3 * cell
        parts.append(_bar((x, y0 - _BAR, z), (x, y0 + cell + _BAR, z), colors[0], 119))
        parts.append(_bar((x0 - _BAR, y, z), (x0 + cell + _BAR, y, z), colors[1], 120))
    return parts


def _odds_and_ends() -> list[Part]:
    """A hoop to fly through, a seesaw, stumps, a tyre, a ball, bushes."""
    turn = 2 * np.pi * np.arange(12) / 12
    hoop = ring(np.stack([0.17 + 0.022 * np.cos(turn), 0.022 * np.sin(turn)], -1), _FINE)
    striped_hoop = Part.of(hoop, partial(striped, colors=(_WHITE, _RED), width=0.09, seed=130))
    plank = slab((0.66, 0.10, 0.04), partial(striped, colors=(_BLUE, _WHITE), width=0.11, seed=132))
    fulcrum = turned(0.17, lambda z: 0.075 - 0.2 * z, EDGE)
    tyre = ring(np.stack([0.115 + 0.045 * np.cos(turn), 0.045 * np.sin(turn)], -1), EDGE)
    ball = stone((0.15, 0.15, 0.15), 0.012, 5, Roughness(rounding=0.075, taper=0, bulge=0, grain=0))
    striped_ball = Part.of(ball, partial(striped, colors=(_WHITE, _RED), width=0.05, seed=152))
    return [
        striped_hoop.placed((-0.02, -0.55, 0.36), 0.35, (0.0, np.pi / 2)),
        _bar((-0.02, -0.55, -0.03), (-0.02, -0.55, 0.19), _WHITE, 131),
        plank.placed((0.98, 0.30, 0.16), np.pi / 2, (0.22, 0.0)),
        Part.of(fulcrum, paint(_PLUM, 133)).placed((0.98, 0.30, -0.02)),
        *(_stump(x, y, height, 140 + k) for k, (x, y, height) in enumerate(_STUMPS)),
        Part.of(tyre, paint(_RUBBER, 150)).placed((-0.88, -0.98, 0.045)),
        Part.of(tyre.copy(), paint(_ORANGE, 151)).placed((-0.86, -0.97, 0.130), 0, (0.05, 0.1)),
        striped_ball.placed((0.12, -1.0, 0), 0.6),
        *(_bush(x, y, size, 160 + k) for k, (x, y, size) in enumerate(_BUSHES)),
    ]


def _stump(x: float, y: float, height: float, seed: int) -> Part:
    stump = turned(height + 0.03, lambda z: 0.075 + 0 * z, EDGE)
    return Part.of(stump, partial(wood, color=_TIMBER, seed=seed, axis=2)).placed((x, y, -0.03))


def _bush(x: float, y: float, size: float, seed: int) -> Part:
    bush = stone((size, size, 0.9 * size), EDGE, seed, Roughness(0.5 * size, 0.1, 0.02, 0.005))
    return Part.of(bush, paint(_LEAF, seed)).placed((x, y, -0.03))
