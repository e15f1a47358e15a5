"""Draft of a robot: its numbers as a person reads and changes them, each with its unit, and the actions on them."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec

from nerfnav.robots import LIMITS, WITH_MASS, BodyFile, Cylinder, Kind, RobotFile, change_kind

_DEGREES = math.degrees(1)
_CALIBRATED = ("width", "height", "fov")
"""Of a camera with a calibration these are in that file."""


@dataclass(frozen=True)
class EditRobot:
    """Change one thing of what describes the robot, without taking it yet; others may be changed at the same time."""

    chosen: RobotFile
    """The robot without any changes."""
    part: str
    """`limits`, `camera`, `inertia`, `position` (of the camera) or `kind`; empty: what is changed stands at the top."""
    name: str
    value: Any
    """In the file's own unit; of a kind, a robot of it, whose mass, inertia and limits are taken."""

    def of(self, draft: RobotFile | None) -> RobotFile:
        """The robot with this change besides those that were made before."""
        told = self.chosen if draft is None else draft
        if self.part == "limits":
            return msgspec.structs.replace(told, limits={**told.limits, self.name: self.value})
        if self.part == "kind":
            moved = {name: getattr(self.value, name) for name in ("kind", "mass", "inertia", "limits")}
            return msgspec.structs.replace(told, **moved)
        if self.part == "camera":
            assert told.camera is not None, "only numbers that there are are changed"
            return msgspec.structs.replace(told, camera=msgspec.structs.replace(told.camera, **{self.name: self.value}))
        if self.part == "inertia":
            assert told.inertia is not None, "only numbers that there are are changed"
            return msgspec.structs.replace(told, inertia=self._along(told.inertia))
        if self.part == "position":
            assert told.camera is not None, "only numbers that there are are changed"
            at = self._along(told.camera.position)
            return msgspec.structs.replace(told, camera=msgspec.structs.replace(told.camera, position=at))
        return msgspec.structs.replace(told, **{self.name: self.value})

    def _along(self, before: tuple[float, float, float]) -> tuple[float, ...]:
        """Three numbers with the one of the changed axis."""
        return tuple(self.value if axis == self.name else old for axis, old in zip("xyz", before, strict=True))


@dataclass(frozen=True)
class ForgetEdits:
    """Forget the changes of the robot that are not taken."""


@dataclass(frozen=True)
class RobotNumber:
    """One number of a robot's file."""

    part: str
    """Where it stands: `limits`, `camera`, or `inertia` and `position` (of the camera), of which it is one axis; empty:
    at the top."""
    name: str
    label: str
    """What people read, with the unit."""
    scale: float = 1.0
    """How many of that unit the file's own unit is."""
    step: float = 0.01
    """How finely it is shown and typed."""

    def of(self, told: RobotFile) -> float | None:
        """Its value in people's unit; None where such a robot has none."""
        if self.part == "limits":
            value = told.limits.get(self.name) if self.name in LIMITS[told.kind] else None
        elif self.part == "camera":
            value = None if told.camera is None else getattr(told.camera, self.name)
            if self.name in _CALIBRATED and told.camera is not None and told.camera.file is not None:
                value = None
        elif self.part in ("inertia", "position"):
            where = told.inertia if self.part == "inertia" else told.camera and told.camera.position
            value = None if where is None else where["xyz".index(self.name)]
        else:
            value = getattr(told, self.name) if told.kind in WITH_MASS else None
        return None if value is None else round(self.scale * value, 6)

    def edit(self, chosen: RobotFile, value: float) -> EditRobot:
        """The change of this number of a robot to another value, in people's unit."""
        return EditRobot(chosen, self.part, self.name, round(value) if self.step == 1 else value / self.scale)


NUMBERS = (
    RobotNumber("", "mass", "Mass [kg]", step=0.001),
    *(RobotNumber("inertia", axis, f"Inertia about {axis} [g m²]", 1e3, step=0.0001) for axis in "xyz"),
    RobotNumber("limits", "thrust", "Most thrust [N]"),
    RobotNumber("limits", "tilt", "Most tilt [°]", _DEGREES, step=0.1),
    RobotNumber("limits", "speed", "Most speed [m/s]"),
    RobotNumber("limits", "body_rate", "Most body rate [°/s]", _DEGREES, step=0.1),
    RobotNumber("limits", "angular_acceleration", "Angular acceleration [rad/s²]"),
    RobotNumber("limits", "force", "Most force [N]"),
    RobotNumber("limits", "acceleration", "Most acceleration [m/s²]"),
    RobotNumber("limits", "yaw_rate", "Most yaw rate [°/s]", _DEGREES, step=0.1),
    RobotNumber("limits", "yaw_acceleration", "Most yaw acceleration [rad/s²]"),
    RobotNumber("camera", "width", "Picture width [pixels]", step=1),
    RobotNumber("camera", "height", "Picture height [pixels]", step=1),
    RobotNumber("camera", "fov", "Field of view [°]"),
    *(
        RobotNumber("position", axis, f"Camera {where} of the middle [m]", step=0.001)
        for axis, where in (("x", "ahead"), ("y", "left"), ("z", "above"))
    ),
    RobotNumber("camera", "pitch", "Camera down [°]", _DEGREES, step=0.1),
)
"""What a person may change, in the order of the page."""


KINDS: dict[Kind, str] = {
    "quadrotor": "quadrotor",
    "couch": "omnidirectional (couch)",
    "diffdrive": "two wheels (diffdrive)",
    "handheld": "carried by hand",
}
"""How a robot may move, as a file and as a person says it."""


def edit_kind(chosen: RobotFile, draft: RobotFile | None, kind: Kind, folder: Path) -> EditRobot:
    """The change to another kind, with what that needs; back to the kind of `chosen`, as it was there.

    `folder` is where meshes lie. Raises InvalidInputError where there can be no such robot.
    """
    told = chosen if draft is None else draft
    return EditRobot(chosen, "kind", kind, chosen if kind == chosen.kind else change_kind(told, kind, folder))


def name_shape(body: BodyFile) -> str:
    """What a body is made of: the name of its field."""
    return next(name for name in ("box", "cylinder", "spheres", "mesh", "urdf") if getattr(body, name) is not None)


def box_of(body: BodyFile, edges: tuple[float, float, float]) -> BodyFile:
    """A box of these edges [m] in place of a body; its points are as far apart as suits it."""
    return BodyFile(box=edges, spacing=body.spacing)


def make_cylinder(body: BodyFile, radius: float, height: float) -> BodyFile:
    """An upright cylinder [m] in place of a body."""
    return BodyFile(cylinder=Cylinder(radius, height), spacing=body.spacing)
