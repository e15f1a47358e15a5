"""An apartment of true size, 9 x 7 x 2.6 m: living room, kitchen, bedroom, study, and the hall between them.

Its walls and its ceiling are plain paint: nothing on them says how far away they are. Doors are 0.8 to 0.9 m wide,
the windows have no glass, a hatch joins kitchen and living room; legs of chairs and wires of lamps are thinner than a
voxel. Its robots are those of rooms: a 25 cm quadrotor, a sofa that passes doors only lengthwise, a cart.

The field is trained from pictures alone by `nerfnav train apartment --iterations 5500 --out
scenes/trained/apartment.npz`; then `python -m nerfnav_scenes.prove apartment` says what is free, see there.
"""

from functools import partial

import numpy as np

from nerfnav.geometry import Box
from nerfnav.world import Scene, Vantage
from nerfnav_scenes.apartment_rooms import furnished
from nerfnav_scenes.finishes import tiles
from nerfnav_scenes.furniture import block, coarse, placed, plain, timber
from nerfnav_scenes.light import Color, Light, from_srgb
from nerfnav_scenes.parts import Part, joined
from nerfnav_scenes.primitives import Size, box, cut, place
from nerfnav_scenes.tasks.apartment import TASKS

Hole = tuple[float, float, float, float]
"""An opening in a wall: from left to right along its x, from low to high [m]."""
LONG, WIDE, HIGH = 4.5, 3.5, 2.6
"""Half the length and half the width inside, and the height of the rooms [m]."""
_OUTER, _INNER = 0.16, 0.10
"""Thickness of walls [m]."""
_MIDDLE, _NORTH, _WEST, _EAST = 0.35, 1.5, -1.3, 0.9
"""Positions of inner walls: south and north, hall and study (y), kitchen and hall, living and bedroom (x) [m].
"""
_DOOR = 2.05
"""Height of doors [m]."""
_FLAT, _FLOOR = 0.08, 0.045
"""Legs of the triangles of what is painted plain, and of the floor [m]."""
_PROUD = 0.004
"""Distance by which boards stand out from the wall that they cover [m]."""
_WHITE, _OAK, _WALNUT = (0.94, 0.93, 0.90), (0.74, 0.53, 0.33), (0.45, 0.29, 0.18)
_PAINTS = {
    "living": (0.90, 0.87, 0.80),
    "bedroom": (0.70, 0.79, 0.86),
    "kitchen": (0.92, 0.84, 0.62),
    "hall": (0.93, 0.92, 0.90),
    "study": (0.74, 0.82, 0.70),
}  # fmt: skip


def build() -> Scene:
    """Build rooms, furnish them, and let the sun in through the windows."""
    parts = [_floor(), *_walls(), *_doors(), *furnished(), _ceiling()]
    # the ceiling glows like a light tent, so that rooms are lit without lamps; the sun comes in by the windows alone
    light = Light(296, 38, (2.3, 1.9, 1.45), (1.35, 1.34, 1.32), (0.42, 0.40, 0.37), 8, 112, sun_through_glass=False)
    mesh, solids = joined(parts, light)
    return Scene(
        name="apartment",
        title="Apartment",
        mesh=mesh,
        solids=solids,
        box=Box.of((-LONG - 0.2, -WIDE - 0.2, -0.12), (LONG + 0.2, WIDE + 0.2, HIGH + 0.12)),
        sky=(0.68, 0.82, 0.96),
        tasks=TASKS,
        voxel=0.04,
        vantage=Vantage.INSIDE,
    )


def _room_of(points: np.ndarray) -> np.ndarray:
    """Names (n,) of the rooms in which points (n, 3) on walls and floors are."""
    x, y = points[:, 0], points[:, 1]
    north = np.where(x < _WEST, "kitchen", np.where(y > _NORTH, "study", "hall"))
    return np.where(y > _MIDDLE, north, np.where(x < _EAST, "living", "bedroom"))


def _floor() -> Part:
    """Oak in the rooms, tiles in kitchen and hall; the top at z = 0."""

    def finish(points: np.ndarray) -> np.ndarray:
        tiled = np.isin(_room_of(points), ("kitchen", "hall"))
        stones = partial(tiles, colors=((0.62, 0.40, 0.30), (0.82, 0.77, 0.68)), size=0.13, seed=1)
        return np.where(tiled[:, None], coarse(stones)(points), timber(_OAK, 2)(points))

    floor = box((2 * LONG + 2 * _OUTER, 2 * WIDE + 2 * _OUTER, 0.08), _FLOOR)
    return Part.of(floor.apply_translation([0, 0, -0.04]), finish)


def _ceiling() -> Part:
    slab = box((2 * LONG + 2 * _OUTER, 2 * WIDE + 2 * _OUTER, 0.08), 0.25)
    return Part.of(slab.apply_translation([0, 0, HIGH + 0.04]), plain(_WHITE), glass=True)


def _door(left: float, right: float) -> Hole:
    return left, right, -0.1, _DOOR


def _walls() -> list[Part]:
    """Outer walls with windows, inner walls with doors; x of a wall that is turned runs along y."""
    ends, sides = (-LONG - _OUTER, LONG + _OUTER), (-WIDE - 0.02, WIDE + 0.02)
    around, across = LONG + _OUTER / 2, WIDE + _OUTER / 2
    hatch = (-2.25, -1.45, 1.05, 1.75)
    turn = np.pi / 2
    return [
        _wall(ends, _OUTER, [(-3.4, -1.6, 0.85, 2.15), (2.0, 3.2, 0.95, 2.1)], (0, -across, 0)),
        _wall(ends, _OUTER, [(0.3, 1.7, 0.95, 2.1)], (0, across, 0)),
        _wall(sides, _OUTER, [(1.5, 2.5, 1.1, 2.1)], (-around, 0, 0), turn),
        _wall(sides, _OUTER, [(-1.6, -0.6, 0.95, 2.1)], (around, 0, 0), turn),
        _wall(
            (-LONG - 0.02, LONG + 0.02),
            _INNER,
            [_door(-3.4, -2.5), hatch, _door(-0.5, 0.35), _door(1.7, 2.5)],
            (0, _MIDDLE, 0),
        ),
        _wall((_MIDDLE, WIDE + 0.02), _INNER, [_door(0.5, 1.35)], (_WEST, 0, 0), turn),
        _wall((_WEST, LONG + 0.02), _INNER, [_door(2.9, 3.75)], (0, _NORTH, 0)),
        _wall((-WIDE - 0.02, _MIDDLE), _INNER, [], (_EAST, 0, 0), turn),
    ]


def _wall(ends: tuple[float, float], depth: float, holes: list[Hole], foot: Size, yaw: float = 0.0) -> Part:
    """A wall along x from `ends[0]` to `ends[1]` less its holes, placed, in the paint of the rooms on either side."""
    mesh = box((ends[1] - ends[0], depth, HIGH + 0.04), _FLAT).apply_translation([sum(ends) / 2, 0, HIGH / 2])
    cutters = [
        box((right - left, 2 * depth, high - low), 10.0).apply_translation([(left + right) / 2, 0, (low + high) / 2])
        for left, right, low, high in holes
    ]
    mesh = place(cut(mesh, cutters), foot, yaw)
    rooms = _room_of(mesh.vertices)
    colors = [from_srgb(color) for color in _PAINTS.values()]
    return Part(mesh, np.select([(rooms == name)[:, None] for name in _PAINTS], colors))


def _doors() -> list[Part]:
    """Frames around the doorways, two leaves that stand open, and the closed door of the apartment."""
    parts = []
    for x, width, y in [(-2.95, 0.9, _MIDDLE), (-0.075, 0.85, _MIDDLE), (2.1, 0.8, _MIDDLE), (3.325, 0.85, _NORTH)]:
        parts += placed(_frame(width, _WHITE), (x, y, 0))
    parts += placed(_frame(0.85, _WHITE), (_WEST, 0.925, 0), np.pi / 2)
    leaf = block((0.80, 0.04, 2.0), (0.40, 0, 0.01), timber(_OAK, 11, 2))
    parts.append(leaf.placed((2.55, _MIDDLE - 0.08, 0), -np.pi / 2 + 0.12))
    parts.append(leaf.placed((2.87, _NORTH + 0.08, 0), np.pi / 2 + 0.15))
    closed = block((0.05, 0.95, 2.05), (LONG - 0.01, 0.925, -0.01), timber(_WALNUT, 13, 2))
    return [*parts, closed]


def _frame(width: float, color: Color) -> list[Part]:
    """Boards around a doorway of a wall along x, which leave all but a few millimetres of it open."""
    deep = _INNER + 0.03
    at = width / 2 + 0.035 - _PROUD
    posts = [block((0.07, deep, _DOOR + 0.07), (side * at, 0, -0.01), plain(color)) for side in (-1, 1)]
    return [*posts, block((width + 0.02, deep, 0.07), (0, 0, _DOOR - _PROUD), plain(color))]
