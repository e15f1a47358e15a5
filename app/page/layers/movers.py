"""Movers: the paths of obstacles that move, and translucent copies of them where they will be."""

from dataclasses import dataclass

import numpy as np
import viser

from nerfnav.geometry import Box
from nerfnav.obstacles import Obstacle
from nerfnav_app.page.layers.nodes import THROUGH, Bodies, Fan, segments
from nerfnav_app.page.layers.obstacles import attitude_of, color_of
from nerfnav_app.page.layers.shapes import Shape
from nerfnav_app.queries.clearance import find_shown_motion
from nerfnav_app.state.obstacles import PlacedObstacle
from nerfnav_app.state.session import Session

_ROOT = "/movers"
PATHS = f"{_ROOT}/paths"
"""Node of the paths."""
_AHEAD, _GHOSTS, _FAINT = 4.0, 4, 0.4
"""Time over which copies show an obstacle without a plan [s], their number, and their opacity."""
_LINE_S, _SAMPLES = 30.0, 300
"""Time over which a motion without way points is drawn [s], and samples of its line."""
_THICKNESS = 0.008  # [m]


@dataclass(frozen=True)
class _Span:
    """Time that the copies cover."""

    begins: float
    """Time of the obstacles that are drawn solid [s]."""
    lasts: float
    """Until the last copy [s]; 0 for no copies."""


_NO_COPIES = _Span(0.0, 0.0)


class MoversLayer:
    """Layer of the paths of obstacles that move, and of their copies over the time of the plan."""

    def __init__(self, server: viser.ViserServer) -> None:
        """Add the lines of all paths, hidden; they are drawn over walls, too."""
        self._server = server
        self._paths = [Fan(server, name, None, _THICKNESS) for name in (PATHS, PATHS + THROUGH)]
        self._ghosts: dict[str, _Ghosts] = {}
        self._made = 0
        self._movers, self._span = tuple[PlacedObstacle, ...](), _NO_COPIES

    def show(self, session: Session) -> None:
        """Draw paths and copies of the obstacles that move and are not hidden."""
        place = session.place
        movers = () if place is None or session.alignment.is_moving else session.movers
        span = _span_of(session) if movers else _NO_COPIES
        if (movers, span) == (self._movers, self._span):
            return
        if movers != self._movers:
            self._show_paths([] if place is None else [_path_of(placed, place.field.box) for placed in movers], movers)
        self._movers, self._span = movers, span
        for name in self._ghosts.keys() - {placed.name for placed in movers}:
            self._ghosts.pop(name).remove()
        for placed in movers:
            if placed.name not in self._ghosts:
                self._made += 1
                self._ghosts[placed.name] = _Ghosts(self._server, f"{_ROOT}/{self._made}", placed.obstacle)
            self._ghosts[placed.name].show(placed.obstacle, span)

    def _show_paths(self, lines: list[np.ndarray], movers: tuple[PlacedObstacle, ...]) -> None:
        """Draw the segments of each path in the colour of its obstacle."""
        counts = [len(line) for line in lines]
        colors = np.repeat([color_of(placed.obstacle) for placed in movers], counts, axis=0) if lines else None
        for fan in self._paths:
            fan.show(np.concatenate(lines) if lines else None, colors)


class _Ghosts:
    """Translucent copies of one obstacle."""

    def __init__(self, server: viser.ViserServer, name: str, obstacle: Obstacle) -> None:
        self._server, self._obstacle = server, obstacle
        self._bodies = Bodies(server, name, color_of(obstacle), _FAINT, _shape_of(obstacle))

    def remove(self) -> None:
        """Take them out of the scene."""
        self._bodies.remove()

    def show(self, obstacle: Obstacle, span: _Span) -> None:
        """Draw the copies, evenly over a span of time."""
        with self._server.atomic():  # corners and faces of two shapes do not fit each other
            if obstacle.shape != self._obstacle.shape:
                self._bodies.reshape(_shape_of(obstacle))
            if obstacle.color != self._obstacle.color:
                self._bodies.paint(color_of(obstacle))
            self._obstacle = obstacle
            times = span.begins + span.lasts * np.arange(1, _GHOSTS + 1 if span.lasts > 0 else 1) / _GHOSTS
            centers = obstacle.place(times).astype(np.float32)
            self._bodies.show(centers, np.tile(attitude_of(obstacle), (len(centers), 1)))


def _span_of(session: Session) -> _Span:
    """Span the motion that is shown as the plan, in flight what is left of it; nothing while motions are played, and at
    the end of a flight."""
    shown, flight = find_shown_motion(session), session.shown_flight
    ended = shown is not None and shown.flown and flight is not None and flight.outcome is not None
    if session.motion_time is not None or ended:
        return _NO_COPIES
    lasts = _AHEAD if shown is None else shown.motion.dt * len(shown.motion.actions)
    return _Span(session.obstacle_time, lasts)


def _path_of(placed: PlacedObstacle, box: Box) -> np.ndarray:
    """Cut the path of an obstacle inside the place into segments (n, 2, 3) [m]."""
    path, obstacle = placed.path, placed.obstacle
    if path is None:
        points = obstacle.place(np.linspace(0.0, _LINE_S, _SAMPLES))
    else:
        points = np.array([*path.points, *path.points[: int(path.closed)]]) + obstacle.position
    lower, upper = box.lower.double().numpy(), box.upper.double().numpy()
    lines = segments(points)
    return lines[((lines >= lower) & (lines <= upper)).all((1, 2))] if path is None else lines


def _shape_of(obstacle: Obstacle) -> Shape:
    mesh = obstacle.shape.mesh()
    return Shape(np.asarray(mesh.vertices, np.float32), np.asarray(mesh.faces, np.uint32))
