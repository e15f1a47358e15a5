"""Alignment marks: the box of the place with its gizmo, the floor, clicked points, and the crop box.

The layers of the place itself draw it as its correction leaves it. What belongs to the place as it was, plans and
flights, is hidden meanwhile.
"""

from collections.abc import Callable
from functools import partial

import numpy as np
import viser
import viser.transforms as tf

from nerfnav.geometry import Box
from nerfnav.importers import Corners
from nerfnav_app.page.kit.theme import BRAND, CANDIDATE, GOAL, STALE, START, Rgb
from nerfnav_app.page.layers.nodes import Fan
from nerfnav_app.state.actions import Command
from nerfnav_app.state.alignment import AlignmentDraft, Correction, Crop, PickTarget, PosePlace, Vector
from nerfnav_app.state.job import JobKind
from nerfnav_app.state.session import Session
from nerfnav_app.state.view import to_point

_THICKNESS, _CROSS = 0.005, 0.035
"""Of lines, and half the size of a point's cross, in longest edges of the place."""
GIZMO, _FACE = 0.3, 0.12
"""Length of the arrows of the place, and of a face of the crop box, in longest edges of the place."""
_AXES = "xyz"
_CELLS = 10
"""Cells of the floor along the longest edge of the place."""
_CORNERS = np.array([[i >> 2, (i >> 1) & 1, i & 1] for i in range(8)])
_EDGES = [(i, i | bit) for i in range(8) for bit in (1, 2, 4) if not i & bit]
_OF_BEFORE = ("/plan", "/flight", "/compared", "/search", "/track", "/space")
"""Parents of nodes that belong to the place as it was."""


class AlignmentLayer:
    """Layer of the correction that is being entered, and of the handles that change it."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """Add the handles; `post` takes what a hand does with them."""
        self._server, self._post = server, post
        self._of_before = [server.scene.add_frame(name, show_axes=False) for name in _OF_BEFORE]
        self._lines: dict[str, Fan] = {}
        self._gizmo = _Handle(server, "/alignment/gizmo", self._turned)
        self._faces = {
            (side, axis): _Handle(server, f"/alignment/{name}_{_AXES[axis]}", partial(self._dragged, side, axis), axis)
            for side, name in enumerate(("lower", "upper"))
            for axis in range(3)
        }
        self._crop: Corners | None = None
        self._label = server.scene.add_label("/alignment/size", "", visible=False, anchor="bottom-center")

    def _turned(self, held: bool) -> None:
        qw, qx, qy, qz = self._gizmo.wxyz.tolist()
        self._post(PosePlace((qw, qx, qy, qz), self._gizmo.position, held))

    def _dragged(self, side: int, axis: int, held: bool) -> None:
        """Move one face of the crop box along its axis."""
        if self._crop is not None:
            corners = np.array(self._crop)
            corners[side, axis] = self._faces[side, axis].position[axis]
            self._post(Crop((to_point(corners[0]), to_point(corners[1])), held))

    def show(self, session: Session) -> None:
        """Draw box, floor, points and handles; lines are added once there is something to draw."""
        draft, place = session.alignment, session.place
        for frame in self._of_before:
            frame.visible = not draft.is_moving
        busy = session.job is not None and session.job.kind is JobKind.PLACE
        box = None if place is None or not draft.is_shown else place.field.box
        self._draw_lines(draft, box)
        self._show_handles(draft, None if busy else box)

    def _draw_lines(self, draft: AlignmentDraft, box: Box | None) -> None:
        self._label.visible = box is not None
        if box is None:
            for line in self._lines.values():
                line.show(None)
            return
        size = float(draft.now.box(box).size.max())
        around = draft.now.box(box)
        low, high = around.lower.tolist(), around.upper.tolist()
        self._label.text = " × ".join(f"{edge:.3g}" for edge in around.size.tolist()) + " m"
        self._label.position = (0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), high[2] + _CROSS * size)
        measured = draft.pointing is PickTarget.DISTANCE or draft.length is not None
        points = crosses(draft.picked, _CROSS * size)
        self._draw("bounds", BRAND, 0.5 * size, turned_edges(draft.now, box))
        self._draw("floor", STALE, 0.4 * size, floor_of(around))
        self._draw("measured", START, size, points if measured else None)
        self._draw("points", GOAL, size, None if measured else points)
        self._draw("kept", CANDIDATE, size, None if draft.now.crop is None else edges_of(draft.now.crop))

    def _draw(self, name: str, color: Rgb, size: float, lines: np.ndarray | None) -> None:
        if name not in self._lines and lines is not None:
            self._lines[name] = Fan(self._server, f"/alignment/{name}", color, _THICKNESS)
        if name in self._lines:
            self._lines[name].thicken(_THICKNESS * size)
            self._lines[name].show(lines)

    def _show_handles(self, draft: AlignmentDraft, box: Box | None) -> None:
        size = 1.0 if box is None else float(draft.now.box(box).size.max())
        if box is None or not draft.by_hand:
            self._gizmo.show(None, GIZMO * size)
        else:
            pose = draft.now.pose(box)
            wxyz = tf.SO3.from_matrix(pose.rotation.numpy()).wxyz
            self._gizmo.show(to_point(pose.position), GIZMO * size, wxyz)
        self._crop = None if box is None else draft.now.crop
        for (side, axis), face in self._faces.items():
            if self._crop is None:
                face.show(None, _FACE * size)
                continue
            middle = np.mean(self._crop, axis=0)
            middle[axis] = self._crop[side][axis]
            face.show(to_point(middle), _FACE * size)


class _Handle:
    """Gizmo of a pose, or of a point on an axis, which a hand is ahead of."""

    def __init__(
        self, server: viser.ViserServer, name: str, moved: Callable[[bool], None], axis: int | None = None
    ) -> None:
        """Add it, hidden; `moved` is called with whether it is still held. With an axis, it moves along that alone."""
        first, second, third = (axis in (None, index) for index in range(3))
        self._node = server.scene.add_transform_controls(
            name, line_width=3.0, active_axes=(first, second, third), disable_rotations=axis is not None,
            depth_test=False, opacity=0.9, visible=False,
        )  # fmt: skip
        self._held, self._moved = False, moved
        self._node.on_update(self._take)

    @property
    def position(self) -> Vector:
        """Position of the handle in the world [m]."""
        return to_point(self._node.position)

    @property
    def wxyz(self) -> np.ndarray:
        """Attitude of the handle (w, x, y, z)."""
        return self._node.wxyz

    async def _take(self, event: viser.TransformControlsEvent) -> None:
        """Runs on the server's event loop, so that moves keep their order."""
        self._held = event.phase != "end"
        self._moved(self._held)

    def show(self, position: Vector | None, size: float, wxyz: np.ndarray | None = None) -> None:
        """Move it, with arrows of a size [m], unless a user drags it; None hides it."""
        self._node.visible = position is not None
        if position is None:
            self._held = False
        elif not self._held:
            self._node.scale = size
            self._node.position = position
            if wxyz is not None:
                self._node.wxyz = wxyz


def crosses(points: tuple[Vector, ...], reach: float) -> np.ndarray | None:
    """Build segments (n, 2, 3) [m] of a cross at each point and of the lines that join them; None without points."""
    if not points:
        return None
    at = np.array(points)
    axes = reach * np.eye(3)
    arms = np.stack([at[:, None] - axes, at[:, None] + axes], 2).reshape(-1, 2, 3)
    joined = np.stack([at, np.roll(at, -1, 0)], 1)
    return np.concatenate([arms, joined])


def edges_of(box: Corners) -> np.ndarray:
    """Build the edges of a box as segments (12, 2, 3) [m]."""
    lower, upper = (np.array(corner) for corner in box)
    corners = lower + _CORNERS * (upper - lower)
    return np.array([[corners[first], corners[second]] for first, second in _EDGES])


def turned_edges(now: Correction, box: Box) -> np.ndarray:
    """Build the edges of the box of the place, turned with it, as segments (12, 2, 3) [m]."""
    edges = edges_of((to_point(box.lower), to_point(box.upper)))
    s, rotation, shift = now.similarity.scale, now.similarity.rotation.numpy(), now.similarity.translation.numpy()
    return s * edges @ rotation.T + shift


def floor_of(around: Box) -> np.ndarray:
    """Build a grid at z = 0 below a box as segments (n, 2, 3) [m], with whole metres or decimals of them as cells."""
    size = around.size.double().numpy()
    cell = 10.0 ** np.round(np.log10(size.max() / _CELLS))
    (x0, y0, _), (x1, y1, _) = around.lower.double().numpy(), around.upper.double().numpy()
    low, high = np.floor(np.array([x0, y0]) / cell), np.ceil(np.array([x1, y1]) / cell)
    along_y = [[(x, low[1], 0), (x, high[1], 0)] for x in np.arange(low[0], high[0] + 0.5)]
    along_x = [[(low[0], y, 0), (high[0], y, 0)] for y in np.arange(low[1], high[1] + 0.5)]
    return cell * np.array(along_y + along_x, dtype=np.float64)
