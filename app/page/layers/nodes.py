"""Scene nodes that several layers use: lines through states, bodies, and the arrays of their vertices."""

import numpy as np
import viser
import viser.transforms as tf

from nerfnav.robots import Motion, RigidState, Robot
from nerfnav_app.page.kit.theme import Rgb, linear
from nerfnav_app.page.layers.shapes import Shape, body_shape, robot_shape
from nerfnav_app.state.session import Session

THROUGH = "/through"
"""Suffix of nodes that page.js draws over everything, faintly."""
_PLACEHOLDER = np.zeros((1, 2, 3), dtype=np.float32)


def positions(states: RigidState) -> np.ndarray:
    """Convert the positions of a sequence of states to (n, 3) [m]."""
    return states.position.detach().numpy().astype(np.float32)


def quaternions(states: RigidState) -> np.ndarray:
    """Convert the attitudes of a sequence of states to (w, x, y, z), (n, 4)."""
    return tf.SO3.from_matrix(states.rotation.detach().double().numpy()).wxyz.astype(np.float32)


def segments(points: np.ndarray) -> np.ndarray:
    """Cut a line through points (n, 3) into its segments (n - 1, 2, 3)."""
    return np.stack([points[:-1], points[1:]], axis=1)


def dashes(points: np.ndarray, count: int = 20) -> np.ndarray:
    """Cut a line through points (n, 3) into dashes (count, 2, 3) of equal length, with gaps as long."""
    along = np.r_[0.0, np.linalg.norm(np.diff(points, axis=0), axis=1).cumsum()]
    at = np.linspace(0, along[-1], 2 * count)
    return np.stack([np.interp(at, along, axis) for axis in points.T], -1).reshape(count, 2, 3)


def drops(points: np.ndarray, floor: float) -> np.ndarray:
    """Build vertical segments (n, 2, 3) [m] from points (n, 3) [m] down to the height `floor` [m]."""
    feet = points.copy()
    feet[:, 2] = floor
    return np.stack([points, feet], axis=1)


class Line:
    """A polyline in one colour; hidden while there are fewer than two points."""

    def __init__(
        self, server: viser.ViserServer, name: str, color: Rgb, thickness: float, through: bool = False
    ) -> None:
        """Add it with a thickness [m]; with `through` it is also drawn, faintly, over what hides it."""
        names = (name, name + THROUGH) if through else (name,)
        self._fans = [Fan(server, each, color, thickness) for each in names]

    def show(self, points: np.ndarray | None, color: Rgb | None = None, dashed: bool = False) -> None:
        """Draw the line through `points` (n, 3) [m], or nothing."""
        lines = None
        if points is not None and len(points) > 1:
            lines = dashes(points) if dashed else segments(points)
        for fan in self._fans:
            fan.show(lines, color)

    def thicken(self, thickness: float) -> None:
        """Draw it with another thickness [m] from now on."""
        for fan in self._fans:
            fan.thicken(thickness)


class Fan:
    """Separate line segments, in one colour or each in its own."""

    def __init__(self, server: viser.ViserServer, name: str, color: Rgb | None, thickness: float) -> None:
        """Add them with a thickness [m]; without a `color` each has its own: a page cannot switch between both."""
        first = np.zeros((1, 2, 3), np.uint8) if color is None else np.array(color, np.uint8)
        self._node = server.scene.add_line_segments(name, _PLACEHOLDER, first, thickness=thickness, visible=False)

    def show(self, lines: np.ndarray | None, color: Rgb | np.ndarray | None = None) -> None:
        """Draw segments (n, 2, 3) [m], or nothing; an array `color` (n, 3) has one for each of them."""
        if lines is not None and len(lines):
            self._node.points = lines.astype(np.float32)
            if isinstance(color, np.ndarray):
                self._node.colors = np.repeat(linear(color)[:, None], 2, axis=1)
            elif color is not None:
                self._node.colors = np.array(color, dtype=np.uint8)
        self._node.visible = lines is not None and len(lines) > 0

    def thicken(self, thickness: float) -> None:
        """Draw them with another thickness [m] from now on."""
        self._node.thickness = thickness


class Trail:
    """Lines of earlier trajectories, the older the fainter."""

    def __init__(self, server: viser.ViserServer, name: str, color: Rgb, thickness: float) -> None:
        """Add it with a thickness [m]."""
        self._color, self._fan = np.array(color), Fan(server, name, None, thickness)

    def show(self, motions: tuple[Motion, ...]) -> None:
        """Draw the lines of `motions`, oldest first."""
        lines = [segments(positions(motion.states)) for motion in motions]
        colors = [
            np.tile((0.15 + 0.45 * (index + 1) / len(lines)) * self._color, (len(line), 1))
            for index, line in enumerate(lines)
        ]
        self._fan.show(np.concatenate(lines) if lines else None, np.concatenate(colors) if lines else None)


class Tube:
    """Translucent mesh around a line."""

    def __init__(self, server: viser.ViserServer, name: str, color: Rgb, opacity: float) -> None:
        """Add it, hidden."""
        self._node = server.scene.add_mesh_simple(
            name,
            np.zeros((3, 3), np.float32),
            np.array([[0, 1, 2]], np.uint32),
            color=color,
            opacity=opacity,
            cast_shadow=False,
            receive_shadow=False,
            visible=False,
        )

    def show(self, shape: Shape | None) -> None:
        """Draw a shape, or nothing, inside a block of `server.atomic`."""
        if shape is not None:
            self._node.vertices, self._node.faces = shape.vertices, shape.faces
        self._node.visible = shape is not None


class Bodies:
    """Bodies of one shape, such as those along a plan."""

    def __init__(
        self, server: viser.ViserServer, name: str, color: Rgb, opacity: float | None, shape: Shape | None = None
    ) -> None:
        """Add them, in the shape of a robot of unknown size where there is no `shape`."""
        self._robot: Robot | None = None
        shape = shape or robot_shape((0.1, 0.1, 0.04))
        self._node = server.scene.add_batched_meshes_simple(
            name,
            shape.vertices,
            shape.faces,
            batched_wxyzs=np.array([[1.0, 0, 0, 0]], dtype=np.float32),
            batched_positions=np.zeros((1, 3), dtype=np.float32),
            batched_scales=np.ones((1, 3), dtype=np.float32),
            batched_colors=color,
            opacity=opacity,
            lod="off",
            cast_shadow=False,
            receive_shadow=False,
            visible=False,
        )

    def embody(self, session: Session) -> None:
        """Draw the body of the place's robot from now on, inside a block of `server.atomic`."""
        if session.place is not None and session.place.robot is not self._robot:
            self._robot = session.place.robot
            self.reshape(body_shape(self._robot.body))

    def reshape(self, shape: Shape) -> None:
        """Draw bodies of another shape from now on, inside a block of `server.atomic`."""
        self._node.vertices, self._node.faces = shape.vertices, shape.faces

    def remove(self) -> None:
        """Take them out of the scene."""
        self._node.remove()

    def paint(self, color: Rgb) -> None:
        """Draw bodies in another colour from now on."""
        self._node.batched_colors = np.array(color, dtype=np.uint8)

    def show_states(self, states: RigidState | None) -> None:
        """Draw a body in each of a sequence of states, or none."""
        if states is None:
            self.show(np.zeros((0, 3)), np.zeros((0, 4)))
        else:
            self.show(positions(states), quaternions(states))

    def show(self, centers: np.ndarray, wxyzs: np.ndarray, scales: np.ndarray | None = None) -> None:
        """Draw a body at each of `centers` (n, 3) [m], or none where n is 0; `scales` (n, 3) are along its axes."""
        if len(centers):
            self._node.batched_positions = centers
            self._node.batched_wxyzs = wxyzs
            self._node.batched_scales = np.ones_like(centers) if scales is None else scales
        self._node.visible = len(centers) > 0
