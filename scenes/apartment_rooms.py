"""Furniture in the rooms of the apartment: a list of pieces for each room, with their places."""

import numpy as np

from nerfnav_scenes.finishes import carpet
from nerfnav_scenes.furniture import (
    bed,
    block,
    bookcase,
    chair,
    cloth,
    cupboard,
    hanging_lamp,
    picture,
    placed,
    plain,
    plant,
    settee,
    standing_lamp,
    table,
    timber,
)
from nerfnav_scenes.parts import Part

_NORTH, _WEST, _SOUTH = np.pi / 2, np.pi, -np.pi / 2
"""Directions of the front of a piece; east is 0."""
_HIGH = 2.6
_OAK, _WALNUT, _TEAL, _RED = (0.74, 0.53, 0.33), (0.45, 0.29, 0.18), (0.13, 0.44, 0.46), (0.74, 0.22, 0.18)
_CREAM, _BLUE, _GREY, _MUSTARD = (0.93, 0.90, 0.82), (0.20, 0.34, 0.58), (0.46, 0.47, 0.50), (0.86, 0.64, 0.20)


def furnished() -> list[Part]:
    """All that stands, lies and hangs in the rooms."""
    return [*_living(), *_kitchen(), *_bedroom(), *_study(), *_hall()]


def _rug(long: float, wide: float, color: tuple[float, float, float], seed: int) -> Part:
    """A carpet 1.5 cm thick with its length along x."""

    def finish(points: np.ndarray) -> np.ndarray:
        return carpet(points / 2.5, color, wide / 5, seed)

    return block((long, wide, 0.025), (0, 0, -0.01), finish)


def _living() -> list[Part]:
    return [
        *placed(settee(1.9, _TEAL, 20), (0.40, -1.75, 0), _WEST),
        *placed(table((0.55, 1.0, 0.42), _WALNUT, 22), (-0.75, -1.75, 0.012)),
        *placed([_rug(2.2, 1.5, _RED, 24)], (-0.75, -1.75, 0), _NORTH),
        *placed(table((1.5, 0.85, 0.75), _OAK, 26), (-3.2, -2.6, 0)),
        *placed(chair(_MUSTARD, 30), (-3.55, -1.98, 0), _SOUTH),
        *placed(chair(_RED, 31), (-2.85, -1.95, 0), _SOUTH - 0.2),
        *placed(chair(_TEAL, 32), (-3.55, -3.2, 0), _NORTH),
        *placed(chair(_BLUE, 33), (-2.85, -3.18, 0), _NORTH + 0.15),
        *placed(hanging_lamp(0.75, _MUSTARD, 36), (-3.2, -2.6, _HIGH)),
        *placed(bookcase((0.30, 1.3, 2.0), _OAK, 38), (-4.35, -0.95, 0)),
        *placed(standing_lamp(1.6, _CREAM, 48), (0.55, -0.45, 0)),
        *placed(plant(1.3, 50), (0.50, -3.10, 0)),
        *placed(cupboard((0.38, 1.5, 0.5), _CREAM, 55), (-0.75, -3.31, 0), _NORTH),
        *placed(picture(1.1, 0.7, (_BLUE, _TEAL, _MUSTARD), 56), (0.85, -1.75, 1.55), _WEST),
        *placed(picture(0.5, 0.7, (_CREAM, _RED, _WALNUT), 58), (-1.05, 0.30, 1.5), _SOUTH),
    ]


def _kitchen() -> list[Part]:
    """A counter along the northern wall, boards above it, a fridge, a small table with two stools."""
    counter: list[Part] = []
    for k, x in enumerate((-4.18, -3.56, -2.94, -2.32)):
        counter += placed(cupboard((0.60, 0.60, 0.86), _CREAM, 60 + k), (x, 3.2, 0), _SOUTH)
    for x in (-4.18, -3.56, -2.32):
        counter += placed(cupboard((0.34, 0.60, 0.62), (0.40, 0.55, 0.52), 64), (x, 3.33, 1.45), _SOUTH)
    return [
        *counter,
        block((2.50, 0.62, 0.05), (-3.25, 3.19, 0.85), timber(_WALNUT, 68)),
        block((0.30, 0.20, 0.26), (-2.30, 3.2, 0.89), cloth(_RED, 69)),
        *placed(cupboard((0.64, 0.60, 1.8), (0.82, 0.84, 0.86), 70), (-1.66, 3.17, 0), _SOUTH),
        *placed(table((0.60, 0.60, 0.75), _OAK, 71), (-1.68, 2.25, 0)),
        *placed(chair(_TEAL, 73), (-2.2, 2.30, 0), 0.1),
        *placed(hanging_lamp(0.7, _RED, 75), (-2.9, 2.2, _HIGH)),
        *placed(picture(0.45, 0.45, (_CREAM, _MUSTARD, _RED), 77), (-4.5, 0.95, 1.5), 0),
    ]


def _bedroom() -> list[Part]:
    return [
        *placed(bed((2.05, 1.6, 0.50), _BLUE, 80), (3.42, -2.55, 0)),
        *placed(cupboard((0.58, 1.8, 2.1), (0.88, 0.86, 0.80), 84), (1.25, -2.4, 0)),
        *placed(table((0.40, 0.40, 0.50), _OAK, 86), (4.25, -1.48, 0)),
        *placed(standing_lamp(1.45, _MUSTARD, 88), (4.25, -0.05, 0)),
        *placed([_rug(1.8, 1.2, _TEAL, 90)], (3.0, -0.9, 0)),
        *placed(chair(_WALNUT, 92), (1.25, -0.95, 0), 0.3),
        *placed(picture(0.9, 0.6, (_MUSTARD, _RED, _CREAM), 94), (0.95, -0.6, 1.5), 0),
    ]


def _study() -> list[Part]:
    return [
        *placed(table((1.5, 0.65, 0.74), _WALNUT, 100), (1.0, 3.13, 0)),
        *placed(chair(_RED, 102), (1.05, 2.62, 0), _NORTH + 0.2),
        block((0.50, 0.05, 0.32), (1.0, 3.3, 0.80), plain((0.08, 0.09, 0.10))),
        block((0.08, 0.08, 0.08), (1.0, 3.3, 0.73), plain(_GREY)),
        *placed(bookcase((0.30, 1.5, 2.1), _WALNUT, 105), (-1.08, 2.5, 0)),
        *placed(settee(1.2, _MUSTARD, 115), (3.95, 2.75, 0), _WEST),
        *placed(plant(1.1, 120), (2.35, 3.2, 0)),
        *placed([_rug(1.7, 1.1, _BLUE, 125)], (0.5, 2.2, 0)),
        *placed(hanging_lamp(0.6, _CREAM, 127), (1.6, 2.3, _HIGH)),
        *placed(picture(0.8, 0.5, (_TEAL, _BLUE, _CREAM), 129), (-0.1, 3.5, 1.5), _SOUTH),
    ]


def _hall() -> list[Part]:
    """A narrow chest, a picture, a lamp; most of it is left free to pass."""
    return [
        *placed(cupboard((0.26, 0.8, 0.8), _TEAL, 130), (0.9, 0.53, 0), _NORTH),
        *placed(hanging_lamp(0.35, _MUSTARD, 132), (1.4, 0.95, _HIGH)),
        *placed(picture(0.9, 0.6, (_RED, _WALNUT, _CREAM), 134), (0.5, 1.45, 1.5), _SOUTH),
    ]
