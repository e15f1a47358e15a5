"""Vantage point: the eye and target from which a place is looked at first.

Imports nothing slow: a surface that was kept is shown while all else is being imported.
"""

import itertools
from collections.abc import Callable, Iterator, Sequence

import numpy as np

Point = tuple[float, float, float]
View = tuple[Point, Point]
"""Where the eye is and what it looks at [m]."""

_FROM = (-0.31, -0.60)
"""Horizontal direction of the eye that is tried first."""
_TURNS, _RISES, _NEARNESS = 8, (0.57, 0.9, 0.3, 2.0), (2.4, 1.5, 1.0)
"""Directions around, heights over horizontal distance, and distances in those of start and goal that are tried."""
_SAMPLES = 48
_SAMPLES_OF_A_SIDE, _TO_A_CORNER, _SPECK = 7, np.deg2rad(40), 0.02
"""Points along each edge of a box that is looked for; angle from the middle of a page to its corners, and size of what
is too small to be found there [rad]."""
FOV = float(np.deg2rad(45))
"""Vertical field of view of a page [rad]."""
_BEHIND = 1.4
"""Distance from a subject, in that of its cameras: most of them have a wider view than a page."""
_WITHIN = 0.9
"""Share of half a page's height within which ends are well seen."""
_EDGE = 1.1
"""Room around a whole box, in sizes of the box on the page."""
_SMALL = 0.2
"""Share of the box's diagonal from which on start and goal are seen well where all of the box is."""


def view_of_box(lower: Point, upper: Point) -> View:
    """The box between two corners [m] from above one side."""
    corners = np.array([lower, upper])
    center, size = corners.mean(0), corners[1] - corners[0]
    reach = float(np.linalg.norm(size))
    eye = center + reach * np.array([*_FROM, 0.57])
    # low places leave room above them for plans; tall ones stand in the middle
    target = center + reach * np.array([0.03, 0.05, 0]) - np.array([0, 0, min(0.6 * size[2], 0.13 * reach)])
    return _point(eye), _point(target)


def view_of_whole_box(lower: Point, upper: Point) -> View:
    """All of the box between two corners [m], seen from that side in a page that is not narrower than high."""
    offsets = 0.5 * (2 * np.array(list(np.ndindex(2, 2, 2))) - 1) * np.subtract(upper, lower)
    back = np.array([*_FROM, 0.57]) / np.linalg.norm([*_FROM, 0.57])
    right = np.array([-_FROM[1], _FROM[0], 0.0]) / np.linalg.norm(_FROM)
    beside = abs(offsets @ np.stack([right, np.cross(back, right)], 1)).max(1)
    distance = float((_EDGE * beside / np.tan(FOV / 2) + offsets @ back).max())
    center = 0.5 * np.add(lower, upper)
    return _point(center + distance * back), _point(center)


def view_of_subject(subject: Point, cameras: np.ndarray) -> View:
    """The subject [m] of photographs from cameras at (n, 3) [m], from behind the middle one of them."""
    middle = cameras[np.linalg.norm(cameras - cameras.mean(0), axis=1).argmin()]
    return _point(subject + _BEHIND * (middle - subject)), subject


def view_of_ends(
    start: Point,
    goal: Point,
    box: tuple[Point, Point],
    is_dense: Callable[[np.ndarray], np.ndarray],
    photographed: View | None = None,
) -> View:
    """The first view in which nothing dense is between the eye and start and goal [m]; else that with the least.

    `is_dense` tells of points (n, 3) [m] whether they are, which points outside of the box are not. The view that was
    `photographed` comes first, where both ends are in it.
    """
    ends, best, least = np.array([start, goal]), None, np.inf
    views = _views(ends, box)
    if photographed is not None and _frames(photographed, ends):
        views = itertools.chain([photographed], views)
    for view in views:
        shares = np.linspace(0.04, 1, _SAMPLES)[:, None, None]
        lines = ends + shares * (np.array(view[0]) - ends)
        hidden = float(is_dense(lines.reshape(-1, 3)).reshape(_SAMPLES, 2).mean(0).max())
        if hidden < least:
            best, least = view, hidden
        if hidden == 0:
            break
    assert best is not None, "some view is tried"
    return best


def is_visible(view: View, lower: Sequence[float], upper: Sequence[float]) -> bool:
    """Check whether a view shows the box between two corners [m] as more than a speck."""
    eye, target = (np.array(point, np.float64) for point in view)
    corners = np.array([lower, upper], np.float64)
    axes = np.linspace(corners[0], corners[1], _SAMPLES_OF_A_SIDE).T
    rays = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3) - eye
    ahead, far = target - eye, np.linalg.norm(rays, axis=-1)
    if not (np.isfinite(rays).all() and np.linalg.norm(ahead) > 0):
        return False
    large = np.linalg.norm(corners[1] - corners[0]) > _SPECK * far.min()
    return bool(large and (rays @ ahead >= np.cos(_TO_A_CORNER) * far * np.linalg.norm(ahead)).any())


def _frames(view: View, points: np.ndarray) -> bool:
    """Check whether points (n, 3) [m] are well within a view."""
    eye, target = np.array(view)
    rays, ahead = points - eye, (target - eye) / np.linalg.norm(target - eye)
    return bool((rays @ ahead > np.cos(_WITHIN * FOV / 2) * np.linalg.norm(rays, axis=1)).all())


def _views(ends: np.ndarray, box: tuple[Point, Point]) -> Iterator[View]:
    apart, middle = float(np.linalg.norm(ends[1] - ends[0])), ends.mean(0)
    if apart > _SMALL * float(np.linalg.norm(np.subtract(box[1], box[0]))):
        yield view_of_box(*box)
    ahead = np.array(_FROM) / np.linalg.norm(_FROM)
    for nearness, rise, turn in itertools.product(_NEARNESS, _RISES, range(_TURNS)):
        angle = (-1) ** turn * ((turn + 1) // 2) * 2 * np.pi / _TURNS  # to both sides in turn
        cosine, sine = np.cos(angle), np.sin(angle)
        flat = (cosine * ahead[0] - sine * ahead[1], sine * ahead[0] + cosine * ahead[1])
        direction = np.array([*flat, rise]) / np.hypot(1, rise)
        yield _point(middle + nearness * apart * direction), _point(middle)


def _point(vector: np.ndarray) -> Point:
    x, y, z = (round(float(value), 4) for value in vector)
    return x, y, z
