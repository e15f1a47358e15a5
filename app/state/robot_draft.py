"""Draft of a robot: its numbers as the user reads and edits them, each with its unit, and the commands on them."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec

from nerfnav.robots import LIMITS, WITH_MASS, BodyFile, Cylinder, Kind, RobotFile, change_kind

_DEGREES = math.degrees(1)
_CALIBRATED = ("width", "height", "fov")
"""Numbers of a camera that its calibration file holds, where it has one."""


@dataclass(frozen=True)
class EditRobot:
    """Edit one entry of the robot's file without using it yet; other entries keep their edits."""

    chosen: RobotFile
    """The robot without any edits."""
    part: str
    """`limits`, `camera`, `inertia`, `position` (of the camera) or `kind`; empty: the top level of the file."""
    name: str
    value: Any
    """In the unit of the file; for a kind, a robot of that kind, whose mass, inertia and limits are copied."""

    def of(self, draft: RobotFile | None) -> RobotFile:
        """Apply the edit to the draft, or to the chosen robot without a draft."""
        robot, change = self.chosen if draft is None else draft, {self.name: self.value}
        if self.part == "limits":
            return msgspec.structs.replace(robot, limits=robot.limits | change)
        if self.part == "kind":
            moved = {name: getattr(self.value, name) for name in ("kind", "mass", "inertia", "limits")}
            return msgspec.structs.replace(robot, **moved)
        if self.part in ("camera", "position"):
            assert robot.camera is not None, "only existing numbers are edited"
            at = {"position": self._along(robot.camera.position)} if self.part == "position" else change
            return msgspec.structs.replace(robot, camera=msgspec.structs.replace(robot.camera, **at))
        if self.part == "inertia":
            assert robot.inertia is not None, "only existing numbers are edited"
            return msgspec.structs.replace(robot, inertia=self._along(robot.inertia))
        return msgspec.structs.replace(robot, **change)

    def _along(self, before: tuple[float, float, float]) -> tuple[float, ...]:
        """Replace the number of the edited axis."""
        return tuple(self.value if axis == self.name else old for axis, old in zip("xyz", before, strict=True))


@dataclass(frozen=True)
class DiscardEdits:
    """Discard the edits of the robot that are not applied."""


@dataclass(frozen=True)
class RobotNumber:
    """One number of a robot's file."""

    part: str
    """`limits`, `camera`, or `inertia` and `position` (of the camera), of which it is one axis; empty: the top level of
    the file."""
    name: str
    label: str
    """Its label, with the unit."""
    scale: float = 1.0
    """Factor from the file's unit to that of the label."""
    step: float = 0.01
    """Resolution of the widget."""

    def of(self, robot: RobotFile) -> float | None:
        """Read its value in the label's unit; None where such a robot has none."""
        if self.part == "limits":
            value = robot.limits.get(self.name) if self.name in LIMITS[robot.kind] else None
        elif self.part == "camera":
            value = None if robot.camera is None else getattr(robot.camera, self.name)
            if self.name in _CALIBRATED and robot.camera is not None and robot.camera.file is not None:
                value = None
        elif self.part in ("inertia", "position"):
            where = robot.inertia if self.part == "inertia" else robot.camera and robot.camera.position
            value = None if where is None else where["xyz".index(self.name)]
        else:
            value = getattr(robot, self.name) if robot.kind in WITH_MASS else None
        return None if value is None else round(self.scale * value, 6)

    def edit(self, chosen: RobotFile, value: float) -> EditRobot:
        """Build the edit that sets it to a value in the label's unit."""
        return EditRobot(chosen, self.part, self.name, round(value) if self.step == 1 else value / self.scale)


NUMBERS = (
    RobotNumber("", "mass", "Mass [kg]", step=0.001),
    *(RobotNumber("inertia", axis, f"Inertia about {axis} [g m²]", 1e3, step=0.0001) for axis in "xyz"),
    RobotNumber("limits", "thrust", "Maximum thrust [N]"),
    RobotNumber("limits", "tilt", "Maximum tilt [°]", _DEGREES, step=0.1),
    RobotNumber("limits", "speed", "Maximum speed [m/s]"),
    RobotNumber("limits", "body_rate", "Maximum body rate [°/s]", _DEGREES, step=0.1),
    RobotNumber("limits", "angular_acceleration", "Maximum angular acceleration [rad/s²]"),
    RobotNumber("limits", "force", "Maximum force [N]"),
    RobotNumber("limits", "acceleration", "Maximum acceleration [m/s²]"),
    RobotNumber("limits", "yaw_rate", "Maximum yaw rate [°/s]", _DEGREES, step=0.1),
    RobotNumber("limits", "yaw_acceleration", "Maximum yaw acceleration [rad/s²]"),
    RobotNumber("camera", "width", "Picture width [pixels]", step=1),
    RobotNumber("camera", "height", "Picture height [pixels]", step=1),
    RobotNumber("camera", "fov", "Field of view [°]"),
    *(
        RobotNumber("position", axis, f"Camera {axis}, {direction} [m]", step=0.001)
        for axis, direction in (("x", "forward"), ("y", "left"), ("z", "up"))
    ),
    RobotNumber("camera", "pitch", "Camera pitch, down [°]", _DEGREES, step=0.1),
)
"""Numbers that can be edited, in the order of the page."""


KINDS: dict[Kind, str] = {
    "quadrotor": "quadrotor",
    "couch": "omnidirectional (couch)",
    "diffdrive": "two wheels (diffdrive)",
    "handheld": "handheld camera",
}
"""Kinds of robots in the file, and their labels."""


def edit_kind(chosen: RobotFile, draft: RobotFile | None, kind: Kind, folder: Path) -> EditRobot:
    """Build the edit to another kind, with the mass, inertia and limits that it needs; its own kind restores `chosen`.

    `folder` holds the meshes. Raises InvalidInputError for an impossible robot.
    """
    robot = chosen if draft is None else draft
    return EditRobot(chosen, "kind", kind, chosen if kind == chosen.kind else change_kind(robot, kind, folder))


def name_shape(body: BodyFile) -> str:
    """Name the shape of a body: the field of its file that is set."""
    return next(name for name in ("box", "cylinder", "spheres", "mesh", "urdf") if getattr(body, name) is not None)


def box_of(body: BodyFile, edges: tuple[float, float, float]) -> BodyFile:
    """Replace a body by a box with these edges [m]; its collision points keep their spacing."""
    return BodyFile(box=edges, spacing=body.spacing)


def make_cylinder(body: BodyFile, radius: float, height: float) -> BodyFile:
    """Replace a body by an upright cylinder [m]."""
    return BodyFile(cylinder=Cylinder(radius, height), spacing=body.spacing)
