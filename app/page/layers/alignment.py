"""Alignment marks: measured points, clicked points of the floor, and the box that is to be kept."""

import numpy as np
import viser

from nerfnav_app.page.kit.theme import CANDIDATE, GOAL, START, Rgb
from nerfnav_app.page.layers.nodes import Fan
from nerfnav_app.state.alignment import Vector
from nerfnav_app.state.session import Session

_THICKNESS, _CROSS = 0.005, 0.035
"""Of lines, and half the size of a point's cross, in longest edges of the place."""
_CORNERS = np.array([[i >> 2, (i >> 1) & 1, i & 1] for i in range(8)])
_EDGES = [(i, i | bit) for i in range(8) for bit in (1, 2, 4) if not i & bit]


class AlignmentLayer:
    """Layer of the points, lines and box of the alignment that is being entered."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._lines: dict[str, Fan] = {}
        self._size: float | None = None

    def show(self, session: Session) -> None:
        """Draw points, lines and box; nodes are added once there is something to draw."""
        draft, place = session.alignment, session.place
        size = None if place is None else float(place.field.box.size.max())
        if size != self._size:  # another place needs lines of another thickness
            for line in self._lines.values():
                line.show(None)
            self._lines, self._size = {}, size
        if size is None:
            return
        box = None if draft.kept is None else edges_of(draft.kept)
        self._draw("measured", START, size, crosses(draft.measured, _CROSS * size))
        self._draw("floor", GOAL, size, crosses(draft.floor, _CROSS * size))
        self._draw("kept", CANDIDATE, size, box)

    def _draw(self, name: str, color: Rgb, size: float, lines: np.ndarray | None) -> None:
        if name not in self._lines and lines is not None:
            self._lines[name] = Fan(self._server, f"/alignment/{name}", color, _THICKNESS * size)
        if name in self._lines:
            self._lines[name].show(lines)


def crosses(points: tuple[Vector, ...], reach: float) -> np.ndarray | None:
    """Build segments (n, 2, 3) [m] of a cross at each point and of the lines that join them; None without points."""
    if not points:
        return None
    at = np.array(points)
    axes = reach * np.eye(3)
    arms = np.stack([at[:, None] - axes, at[:, None] + axes], 2).reshape(-1, 2, 3)
    joined = np.stack([at, np.roll(at, -1, 0)], 1)
    return np.concatenate([arms, joined])


def edges_of(box: tuple[Vector, Vector]) -> np.ndarray:
    """Build the edges of a box as segments (12, 2, 3) [m]."""
    lower, upper = (np.array(corner) for corner in box)
    corners = lower + _CORNERS * (upper - lower)
    return np.array([[corners[first], corners[second]] for first, second in _EDGES])
