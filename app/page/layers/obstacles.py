"""Obstacles: a mesh each, and the handles of the chosen one, with which a hand moves, turns or scales it.

The page moves the mesh below the handles by itself; a new size comes from the session. Handles of one that moves are
where it is at take-off.
"""

from collections.abc import Callable

import numpy as np
import viser
import viser.transforms as tf

from nerfnav.obstacles import CutOut, Obstacle
from nerfnav_app.page.kit.theme import CANDIDATE, HIT, Rgb
from nerfnav_app.page.kit.widgets import post_on
from nerfnav_app.places.surface_glb import split_glb
from nerfnav_app.queries.placed_obstacles import PlacedObstaclesQuery
from nerfnav_app.state.actions import Command
from nerfnav_app.state.alignment import Vector
from nerfnav_app.state.obstacles import ChangeObstacle, ChooseObstacle, GizmoMode, PlacedObstacle
from nerfnav_app.state.session import Session
from nerfnav_app.state.view import to_point

SIZES = {GizmoMode.MOVE: 1.1, GizmoMode.TURN: 0.9, GizmoMode.SCALE: 0.4}
"""Size of the handles, in longest edges of the obstacle."""
_CHOSEN, _SELECTING = 0.75, 0.35
"""Opacity of the chosen obstacle, behind which the plan shines through, and of a volume that selects, or of an obstacle
where it was at take-off."""
_Post = Callable[[Command], None] | None
_ROOT = "/obstacles"
HANDLES = f"{_ROOT}/handles"
"""Node of the handles."""


class ObstaclesLayer:
    """Layer of the obstacles of the page."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """Add the handles, hidden; `post` takes what a hand does with them, and clicks on obstacles."""
        self._server, self._post = server, post
        self._nodes: dict[str, _Node | _Part] = {}
        self._made = 0
        self._handles = _Handles(server, post)

    def show(self, session: Session) -> None:
        """Draw the obstacles that are not hidden, and the handles of the chosen one."""
        there = session.place is not None and not session.alignment.is_moving
        drawn = {placed.name: placed for placed in session.obstacles if not placed.hidden} if there else {}
        for name, node in list(self._nodes.items()):
            if name not in drawn or isinstance(node, _Part) != (drawn[name].cut_out is not None):
                self._nodes.pop(name).remove()
        answered = PlacedObstaclesQuery.result_in(session)
        wrong = {} if answered is None else answered.problems
        chosen = drawn.get(session.chosen or "")
        carried = chosen is not None and session.gizmo_mode is not GizmoMode.SCALE
        time = session.obstacle_time
        for name, placed in drawn.items():
            if name not in self._nodes:
                self._made += 1
                make = _Node if placed.cut_out is None else _Part
                self._nodes[name] = make(self._server, f"{_ROOT}/{self._made}", self._post)
            visible = placed is not chosen or not carried or (placed.moves and time > 0)
            self._nodes[name].show(placed, name in wrong, visible, session.surface, time)
        self._handles.show(chosen, session.gizmo_mode, chosen is not None and chosen.name in wrong, session)


class _Handles:
    """Handles of one obstacle, with its mesh below them unless they scale it."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        self._post, self._placed, self._mode, self._dragged = post, None, GizmoMode.MOVE, False
        self._gizmo = server.scene.add_transform_controls(
            HANDLES, line_width=3.0, depth_test=False, opacity=0.9, visible=False
        )
        self._body = _Node(server, f"{HANDLES}/body", below_handles=True)
        self._part = _Part(server, f"{HANDLES}/part", below_handles=True)
        self._gizmo.on_update(self._moved)
        self._placed: PlacedObstacle | None

    async def _moved(self, event: viser.TransformControlsEvent) -> None:
        """Runs on the server's event loop, so that moves keep their order."""
        placed, held = self._placed, event.phase != "end"
        self._dragged = held
        if placed is not None:
            changed = follow_handles(placed, self._mode, to_point(event.target.position), event.target.wxyz)
            self._post(ChangeObstacle(placed.name, changed, held))

    def show(self, placed: PlacedObstacle | None, mode: GizmoMode, wrong: bool, session: Session) -> None:
        """Move them to an obstacle, unless a user drags them: the hand is ahead of the session."""
        scales = mode is GizmoMode.SCALE
        half = None if placed is None else placed.half_extents
        before, self._placed = self._placed, placed
        switched = placed is None or before is None or before.name != placed.name or mode is not self._mode
        self._mode = mode
        self._gizmo.visible = placed is not None and (half is not None or not scales)
        if placed is None:
            self._dragged = False
            return
        is_part = placed.cut_out is not None
        self._body.show(placed, wrong, not scales and not is_part, session.surface, session.obstacle_time)
        self._part.show(placed, wrong, not scales and is_part, session.surface)
        if self._dragged and not switched:
            return
        self._dragged, obstacle = False, placed.obstacle
        corner = obstacle.attitude @ np.array(half) if scales and half is not None else np.zeros(3)
        size = float(np.diff(obstacle.span(obstacle.attitude.T), axis=0).max())
        self._gizmo.disable_rotations = mode is not GizmoMode.TURN
        self._gizmo.disable_axes = self._gizmo.disable_sliders = mode is GizmoMode.TURN
        self._gizmo.scale = SIZES[mode] * size
        self._gizmo.position = np.array(obstacle.position) + corner
        self._gizmo.wxyz = attitude_of(obstacle)


def follow_handles(placed: PlacedObstacle, mode: GizmoMode, position: Vector, wxyz: np.ndarray) -> PlacedObstacle:
    """Give an obstacle the pose of its handles, or the size by which they are at its corner."""
    match mode:
        case GizmoMode.MOVE:
            x, y, z = (round(value, 4) for value in position)
            return placed.changed(position=(x, y, z))
        case GizmoMode.TURN:
            roll, pitch, yaw = (round(float(angle), 5) for angle in tf.SO3(wxyz).normalize().as_rpy_radians())
            return placed.changed(rotation=(roll, pitch, yaw))
        case GizmoMode.SCALE:
            corner = placed.obstacle.attitude.T @ (np.array(position) - placed.obstacle.position)
            x, y, z = (round(float(edge), 4) for edge in corner)
            return placed.scaled((x, y, z))


class _Drawn:
    """One obstacle after the other in a node of the scene."""

    def __init__(self, server: viser.ViserServer, name: str, post: _Post = None, below_handles: bool = False) -> None:
        """Clicks on it choose the obstacle, with a `post`: else they would keep a hand from handles behind it.

        Handles that it is below have its pose.
        """
        self._server, self._name, self._post, self._below_handles = server, name, post, below_handles
        self._placed: PlacedObstacle | None = None

    def _choose_on_click(self, node: viser.MeshHandle | viser.GlbHandle) -> None:
        if self._post is not None:
            post_on(node.on_click, self._post, self._choose)

    def _choose(self) -> ChooseObstacle | None:
        return None if self._placed is None else ChooseObstacle(self._placed.name)


class _Node(_Drawn):
    """Mesh of one obstacle after the other."""

    def __init__(self, server: viser.ViserServer, name: str, post: _Post = None, below_handles: bool = False) -> None:
        """Add it, hidden; see _Drawn."""
        super().__init__(server, name, post, below_handles)
        self._pose: tuple[float, ...] = ()
        self._node = server.scene.add_mesh_simple(
            name, np.zeros((3, 3), np.float32), np.array([[0, 1, 2]], np.uint32), flat_shading=True,
            cast_shadow=False, receive_shadow=False, visible=False,
        )  # fmt: skip
        self._choose_on_click(self._node)

    def remove(self) -> None:
        """Take it out of the scene."""
        self._node.remove()

    def show(
        self, placed: PlacedObstacle, wrong: bool, visible: bool, surface: bytes | None, time: float = 0.0
    ) -> None:
        """Draw an obstacle where it is at a time [s], red where it is `wrong`."""
        obstacle, before = placed.obstacle, None if self._placed is None else self._placed.obstacle
        self._placed = placed
        if before is None or obstacle.shape != before.shape:
            mesh = obstacle.shape.mesh()
            with self._server.atomic():  # corners and faces of two shapes do not fit each other
                self._node.vertices = np.asarray(mesh.vertices, np.float32)
                self._node.faces = np.asarray(mesh.faces, np.uint32)
        at = obstacle.place(np.array([time]))[0].tolist() if placed.moves else obstacle.position
        pose = (*at, *obstacle.rotation)
        if pose != self._pose and not self._below_handles:
            self._pose = pose
            self._node.position, self._node.wxyz = np.array(at), attitude_of(obstacle)
        color = HIT if wrong else CANDIDATE if placed.selects else color_of(obstacle)
        left = self._below_handles and placed.moves and time > 0  # it is drawn where it is by then, too
        # with an opacity of 1, a browser would hide what is within translucent copies
        opacity = _SELECTING if placed.selects or left else _CHOSEN if self._below_handles else None
        if (self._node.color, self._node.opacity) != (color, opacity):
            self._node.color, self._node.opacity = color, opacity
        self._node.visible = visible


class _Part(_Drawn):
    """Part of the field's surface that was cut out, one after the other; added once there is a surface."""

    _node: viser.GlbHandle | None = None
    _surface: bytes | None = None
    _shape: CutOut | None = None

    def remove(self) -> None:
        """Take it out of the scene."""
        if self._node is not None:
            self._node.remove()

    def show(
        self, placed: PlacedObstacle, wrong: bool, visible: bool, surface: bytes | None, time: float = 0.0
    ) -> None:
        """Draw a cut-out, which stands at any time, where it is now, as it looks in the surface."""
        self._placed, shape = placed, placed.cut_out
        if visible and shape is not None and surface is not None and (self._surface, self._shape) != (surface, shape):
            self._surface, self._shape = surface, shape
            glb = split_glb(surface, shape, inside=True)
            if self._node is None:
                self._node = self._server.scene.add_glb(self._name, glb, cast_shadow=False, receive_shadow=False)
                self._choose_on_click(self._node)
            else:
                self._node.glb_data = glb
        if self._node is None:
            return
        if shape is not None:
            back = shape.source.attitude.T
            obstacle = placed.obstacle
            turn = back if self._below_handles else obstacle.attitude @ back
            to = np.zeros(3) if self._below_handles else np.array(obstacle.position)
            self._node.wxyz = tf.SO3.from_matrix(turn).wxyz
            self._node.position = to - turn @ np.array(shape.position)
        self._node.visible = visible and (self._surface, self._shape) == (surface, shape)


def attitude_of(obstacle: Obstacle) -> np.ndarray:
    """Compute the attitude of an obstacle as (w, x, y, z)."""
    return tf.SO3.from_matrix(obstacle.attitude).wxyz


def color_of(obstacle: Obstacle) -> Rgb:
    """Convert the colour of an obstacle to bytes."""
    red, green, blue = (round(255 * part) for part in obstacle.color)
    return red, green, blue
