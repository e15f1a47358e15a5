"""Start and goal: a gizmo with the robot's body and a label each."""

import math
from collections.abc import Callable

import numpy as np
import viser
import viser.transforms as tf

from nerfnav.robots import Robot
from nerfnav_app.page.kit.theme import GOAL, HIT, START
from nerfnav_app.page.layers.nodes import Fan, drops
from nerfnav_app.page.layers.shapes import body_shape
from nerfnav_app.places.ends import End, EndRole
from nerfnav_app.state.actions import ClickScene, Command, MoveEnd
from nerfnav_app.state.alignment import Ray
from nerfnav_app.state.session import Session
from nerfnav_app.state.view import to_point

GIZMO = 0.24
"""Size of the arrows in places of the paper's scale [m]."""
_OF_THE_WAY, _OF_THE_BODY = 0.18, 1.6
"""Size of the arrows as a share of the distance of the first start and goal, and at least of the robot's length."""
_COLORS = {EndRole.START: START, EndRole.GOAL: GOAL}


class EndsLayer:
    """Layer of start and goal once the place is open."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """Listen to clicks into the scene; `post` takes moves and clicks."""
        self._server, self._post = server, post
        self._handles: dict[EndRole, _Handle] = {}

        @server.scene.on_click()
        def _(event: viser.SceneClickEvent) -> None:
            post(ClickScene(Ray(to_point(event.ray_origin), to_point(event.ray_direction))))

    def show(self, session: Session) -> None:
        """Move the gizmos to start and goal."""
        if session.place is None or session.seeking or session.alignment.is_moving:
            for handle in self._handles.values():
                handle.hide()
            return
        if not self._handles:
            robot = session.place.robot
            self._handles = {which: _Handle(self._server, which, robot, self._post) for which in EndRole}
        for which, handle in self._handles.items():
            handle.size(gizmo_size(session))
            handle.shape(session.place.robot)
            handle.show(session.ends.of(which), session.problems.get(which) is not None)
            handle.stand_on(float(session.place.field.box.lower[2]))


def gizmo_size(session: Session) -> float:
    """Compute the size of the arrows [m] from the first distance of start and goal, rounded to a power of two.

    It does not change while an end is dragged.
    """
    place, ends = session.place, session.first_ends
    if place is None or ends is None:
        return GIZMO
    apart = math.dist(ends.start.position, ends.goal.position)
    size = max(_OF_THE_WAY * apart, _OF_THE_BODY * max(place.robot.body.extents[:2]))
    return GIZMO * 2.0 ** round(math.log2(size / GIZMO))


class _Handle:
    """Gizmo of one end."""

    def __init__(
        self, server: viser.ViserServer, which: EndRole, robot: Robot, post: Callable[[Command], None]
    ) -> None:
        self._server, self._which, self._post, self._end = server, which, post, End()
        self._robot = robot
        self._dragged, self._yaw = False, 0.0
        name = f"/{which.value}"
        self._gizmo = server.scene.add_transform_controls(
            name, scale=GIZMO, line_width=3.0, disable_rotations=True, depth_test=False, opacity=0.9
        )
        shape = body_shape(robot.body)
        self._body = server.scene.add_mesh_simple(
            f"{name}/body",
            shape.vertices,
            shape.faces,
            color=_COLORS[which],
            flat_shading=True,
            cast_shadow=False,
            receive_shadow=False,
        )
        self._label = server.scene.add_label(
            f"{name}/label", which.value, position=(0, 0, 1.1 * GIZMO), anchor="bottom-center"
        )
        self._drop = Fan(server, f"{name}/drop", _COLORS[which], 0.004)
        self._drop_to: tuple[End, float] | None = None
        self._gizmo.on_update(self._moved)

    def stand_on(self, floor: float) -> None:
        """Draw the drop line to the height `floor` [m]."""
        if (self._end, floor) != self._drop_to:
            self._drop_to = self._end, floor
            self._drop.show(drops(np.zeros((1, 3)), floor - self._end.position[2]))

    def size(self, gizmo: float) -> None:
        """Set the size of the arrows [m]."""
        if self._gizmo.scale != gizmo:
            self._gizmo.scale = gizmo
            self._label.position = (0, 0, 1.1 * gizmo)

    def hide(self) -> None:
        """Hide it while the end is unknown."""
        self._gizmo.visible = False

    def shape(self, robot: Robot) -> None:
        """Take the shape of another robot's body."""
        if robot is self._robot:
            return
        self._robot = robot
        shape = body_shape(robot.body)
        with self._server.atomic():  # corners and faces of two shapes do not fit each other
            self._body.vertices, self._body.faces = shape.vertices, shape.faces

    async def _moved(self, event: viser.TransformControlsEvent) -> None:
        """Runs on the server's event loop, so that moves keep their order."""
        self._dragged = event.phase != "end"
        self._post(MoveEnd(self._which, End(to_point(event.target.position), self._end.yaw), held=self._dragged))

    def show(self, end: End, blocked: bool) -> None:
        """Move it to `end`, unless a user drags it: the hand is ahead of the session."""
        self._end = end
        self._gizmo.visible = True
        if not self._dragged and math.dist(self._gizmo.position, end.position) > 1e-6:
            self._gizmo.position = end.position
        if self._yaw != end.yaw:
            self._yaw = end.yaw
            self._body.wxyz = tf.SO3.from_z_radians(end.yaw).wxyz
        self._body.color = HIT if blocked else _COLORS[self._which]
        self._label.text = f"{self._which.value}: no room" if blocked else self._which.value
