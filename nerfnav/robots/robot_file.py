"""Robots in files: kind, constants, body, limits and camera, described in YAML, in SI units (kg, m, s, N, rad).

    name: scout
    kind: quadrotor                                    # quadrotor, couch, diffdrive or handheld
    mass: 0.7
    inertia: [4.0e-3, 4.0e-3, 7.3e-3]                  # quadrotors; left out: of a solid box
    body: {box: [0.25, 0.25, 0.08]}                    # see robots/body_file.py
    limits: {thrust: 16.8, tilt: 0.9, speed: 3.0}      # all may be left out
    camera: {position: [0.1, 0, 0.05], pitch: 0.2, width: 200, height: 200, fov: 90}
    camera: {file: camera.yaml, pitch: -0.3}           # or a calibration, see formats/camera_file.py

Limits that are left out are those of the bundled robot of the same kind, at the size and mass of this one: under the
same thrust per weight a quadrotor L times as large turns L times as slowly (Froude scaling: angular accelerations go
with 1 / L, body rates with 1 / sqrt(L)). The camera stands at `position` [m] in the body's axes and looks ahead,
`pitch` [rad] downwards; `fov` is its horizontal field of view [degrees].
"""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

import msgspec
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.formats import read_camera
from nerfnav.geometry import FORWARD_MOUNT, Camera, Pose, so3
from nerfnav.robots.body_file import BodyFile, Vector, body_of
from nerfnav.robots.couch import Couch, CouchConfig
from nerfnav.robots.diffdrive import DiffDrive, DiffDriveConfig
from nerfnav.robots.handheld import HandHeld
from nerfnav.robots.quadrotor import Quadrotor
from nerfnav.robots.quadrotor_config import QuadrotorConfig
from nerfnav.robots.robot import CAMERA, Robot


class CameraFile(msgspec.Struct, forbid_unknown_fields=True):
    """Entry `camera` of a robot's file."""

    position: Vector = (0.0, 0.0, 0.0)
    pitch: float = 0.0
    width: int | None = None
    height: int | None = None
    fov: float = 90.0
    file: str | None = None


def mount_of(position: Vector, pitch: float) -> Pose:
    """Compute T_body_camera of a camera at `position` [m] in the body that looks ahead, `pitch` [rad] downwards."""
    if not all(map(math.isfinite, position)) or not abs(pitch) <= math.pi / 2:
        raise InvalidInputError(
            f"a camera looks at most pi/2 = 1.57 rad downwards or upwards, not {pitch:g}, from a finite position"
        )
    downwards = so3.exp(torch.tensor([0.0, pitch, 0.0]))
    return Pose(downwards @ FORWARD_MOUNT.rotation, torch.tensor(position))


def _camera_of(entry: CameraFile, folder: Path) -> Camera:
    if entry.file is not None:
        if (entry.width, entry.height) != (None, None):
            raise InvalidInputError("a camera's size is in its calibration: leave out width and height beside `file`")
        return read_camera(folder / entry.file)
    width = CAMERA.width if entry.width is None else entry.width
    height = CAMERA.height if entry.height is None else entry.height
    if max(width, height) > _MOST_PIXELS:
        raise InvalidInputError(
            f"a camera's picture is at most {_MOST_PIXELS} pixels wide or high, not {width} x {height}"
        )
    return Camera.from_fov(width, height, entry.fov)


_MOST_PIXELS = 8192
"""Largest width or height of a camera that is simulated."""
_RANGE = 1e-4, 1e6
"""Least and largest mass and limit of a vehicle, in SI units."""
_INERTIA = 1e-4, 10.0
"""Least and largest moment of inertia of a vehicle, in its mass times the square of its length: those of drones are
0.02 to 0.1."""


Kind = Literal["quadrotor", "couch", "diffdrive", "handheld"]
"""Kind of a robot's motion."""
SUFFIXES = (".yaml", ".yml")
"""Suffixes of robots' files."""
LIMITS = {
    "quadrotor": {
        "thrust": "max_thrust",
        "tilt": "max_tilt",
        "speed": "max_speed",
        "body_rate": "max_rate",
        "angular_acceleration": "angular_acceleration",
    },
    "couch": {name: f"max_{name}" for name in ("speed", "yaw_rate", "force")},
    "diffdrive": {name: f"max_{name}" for name in ("speed", "yaw_rate", "acceleration", "yaw_acceleration")},
    "handheld": {},
}
"""Kind of robot to the limits that its file may have, each with the name in its configuration."""


class RobotFile(msgspec.Struct, forbid_unknown_fields=True):
    """Robot's file: kind, body, constants, limits and camera."""

    name: str
    kind: Kind
    body: BodyFile
    mass: float | None = None
    """[kg]; quadrotors and couches have one."""
    inertia: Vector | None = None
    """Diagonal of J [kg m^2]; quadrotors have one."""
    limits: dict[str, float] = {}
    """Limits of the robot."""
    camera: CameraFile | None = None
    """Camera of the robot; left out: 200 x 200 pixels, 90 degrees, ahead."""


_LONGEST_REASON = 300
"""Characters of a reader's message that are printed."""


def read_robot(path: Path) -> Robot:
    """Read the robot of a file. Raises InvalidInputError for one that cannot be read, or is impossible."""
    entry = decode_robot_file(path)
    try:
        return robot_of(entry, path.parent)
    except InvalidInputError as error:
        raise InvalidInputError(f"{path}: {error}") from error


def decode_robot_file(path: Path) -> RobotFile:
    """Decode a robot's file, without a check of the robot. Raises InvalidInputError for a file of another kind."""
    try:
        return msgspec.yaml.decode(path.read_bytes(), type=RobotFile, strict=False)  # "1e-3" is a number, too
    except FileNotFoundError as error:
        raise InvalidInputError(f"there is no robot file {path}") from error
    except (OSError, ValueError, TypeError, OverflowError, RecursionError) as error:  # msgspec's and yaml's own
        reason = " ".join(str(error).replace("`", "").split())[:_LONGEST_REASON]
        raise InvalidInputError(f"{path} is no robot file: {reason}") from error


def robot_of(entry: RobotFile, folder: Path) -> Robot:
    """Make the robot of a file; its meshes lie in `folder`. Raises InvalidInputError for an impossible one."""
    if not entry.name.strip():
        raise InvalidInputError("a robot needs a name")
    body, counts = body_of(entry.body, folder)
    shared = {"name": entry.name, "extents": body.extents, "point_counts": counts}
    robot, camera = _MAKERS[entry.kind](entry, shared).with_body(body), entry.camera
    if camera is None:
        return robot
    return robot.with_camera(_camera_of(camera, folder), mount_of(camera.position, camera.pitch))


def _quadrotor(entry: RobotFile, shared: dict[str, Any]) -> Robot:
    usual, mass = QuadrotorConfig(), _in_range("mass", entry.mass)
    larger = math.dist(shared["extents"], (0, 0, 0)) / math.dist(usual.extents, (0, 0, 0))
    inertia = _inertia_of_box(mass, shared["extents"])
    if entry.inertia is not None:
        _check_inertia(inertia := entry.inertia, mass, max(shared["extents"]))
    limits = _limits(
        entry,
        usual,
        thrust=usual.max_thrust / usual.weight * mass * usual.gravity,
        body_rate=usual.max_rate / math.sqrt(larger),
        angular_acceleration=usual.angular_acceleration / larger,
    )
    config = QuadrotorConfig(mass=mass, inertia=inertia, **limits, **shared)
    if config.max_thrust <= config.weight:
        raise InvalidInputError(
            f"a thrust of {config.max_thrust:g} N does not lift {mass:g} kg: more than {config.weight:.3g} N are needed"
        )
    if config.max_tilt >= math.pi / 2:
        raise InvalidInputError(f"a tilt stays below pi/2 = 1.57 rad, not {config.max_tilt:g}: is it in degrees?")
    return Quadrotor(config)


def _couch(entry: RobotFile, shared: dict[str, Any]) -> Robot:
    _refuse(entry, "inertia")
    usual, mass = CouchConfig(), _in_range("mass", entry.mass)
    limits = _limits(entry, usual, force=usual.max_force / usual.mass * mass)
    return Couch(CouchConfig(mass=mass, **limits, **shared))


def _diffdrive(entry: RobotFile, shared: dict[str, Any]) -> Robot:
    _refuse(entry, "mass", "inertia")
    return DiffDrive(DiffDriveConfig(**_limits(entry, DiffDriveConfig()), **shared))


def _handheld(entry: RobotFile, shared: dict[str, Any]) -> Robot:
    _refuse(entry, "mass", "inertia")
    _limits(entry, None)
    return HandHeld(entry.name)


_MAKERS: dict[str, Callable[[RobotFile, dict[str, Any]], Robot]] = {
    "quadrotor": _quadrotor, "couch": _couch, "diffdrive": _diffdrive, "handheld": _handheld,
}  # fmt: skip


def _limits(entry: RobotFile, usual: Any, **scaled: float) -> dict[str, float]:
    """Collect the given limits, else those `scaled` to its size, else the usual ones; named as in configurations."""
    named = LIMITS[entry.kind]
    unknown = entry.limits.keys() - named
    if unknown:
        known = ", ".join(named) or "none"
        raise InvalidInputError(f"a {entry.kind} has no limit {sorted(unknown)[0]!r}; it has {known}")
    left_out = {name: getattr(usual, attribute) for name, attribute in named.items()} | scaled
    given = {name: _in_range(name, value) for name, value in entry.limits.items()}
    return {named[name]: value for name, value in (left_out | given).items()}


def _refuse(entry: RobotFile, *names: str) -> None:
    for name in names:
        if getattr(entry, name) is not None:
            raise InvalidInputError(f"a {entry.kind} moves without {name}: leave it out")


def _above_zero(name: str, value: float | None) -> float:
    if value is None:
        raise InvalidInputError(f"{name} is missing")
    if not 0 < value < math.inf:
        raise InvalidInputError(f"{name} is a number above 0, not {value:g}")
    return value


def _in_range(name: str, value: float | None) -> float:
    """Return a mass or a limit in SI units. Raises InvalidInputError for one that no vehicle has."""
    value, (least, most) = _above_zero(name, value), _RANGE
    if not least <= value <= most:
        raise InvalidInputError(f"{name} is a number from {least:g} to {most:g}, not {value:g}")
    return value


def _check_inertia(inertia: Vector, mass: float, length: float) -> None:
    """Refuse moments that no vehicle of this mass [kg] and length [m] has, nor any other mass distribution."""
    low, high = (share * mass * length**2 for share in _INERTIA)
    for moment in inertia:
        if not low <= _above_zero("inertia", moment) <= high:
            raise InvalidInputError(
                f"a vehicle of {mass:g} kg and {length:g} m has moments of inertia of {low:.2g} to {high:.2g} kg m^2, "
                f"not {moment:g}: leave inertia out to take that of a solid box"
            )
    if 2 * max(inertia) > sum(inertia) * (1 + 1e-9):
        raise InvalidInputError(f"no body has moments of inertia of {inertia}: none exceeds the sum of the two others")


def _inertia_of_box(mass: float, extents: Vector) -> Vector:
    x, y, z = (edge * edge for edge in extents)
    return mass / 12 * (y + z), mass / 12 * (x + z), mass / 12 * (x + y)
