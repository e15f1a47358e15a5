"""Robots as files: what describes a robot, all its numbers told, and as YAML again."""

from pathlib import Path

import msgspec

from nerfnav.robots.body_file import BodyFile
from nerfnav.robots.camera_file import CameraFile
from nerfnav.robots.robot import CAMERA
from nerfnav.robots.robot_file import LIMITS, RobotFile, decoded
from nerfnav.robots.robots import BUNDLED, is_file, load

WITH_MASS = ("quadrotor", "couch")
"""Kinds of robots that have a mass."""


def described(name: str) -> tuple[RobotFile, Path]:
    """What describes a robot, a name or a file as `load` knows it, and the folder that its meshes lie in.

    Mass, inertia, limits and camera that its file leaves out are told as they come out. Raises as `load` does.
    """
    robot = load(name)
    file = Path(name) if is_file(name) else BUNDLED / f"{name}.yaml"
    config = getattr(robot, "config", None)
    if file.is_file():
        told = decoded(file)
    else:
        box = BodyFile(box=config.extents, points=config.point_counts)  # type: ignore[union-attr]
        told = RobotFile(name=robot.name, kind=robot.name, body=box)  # type: ignore[arg-type]
    known = LIMITS[told.kind]
    told.limits = {limit: getattr(config, attribute) for limit, attribute in known.items()} or told.limits
    if told.kind in WITH_MASS:
        told.mass = getattr(config, "mass", told.mass)
    if told.kind == "quadrotor":
        told.inertia = getattr(config, "inertia", told.inertia)
    told.camera = told.camera or CameraFile()
    if told.camera.file is None:
        told.camera.width, told.camera.height = told.camera.width or CAMERA.width, told.camera.height or CAMERA.height
    return told, file.parent


def to_yaml(told: RobotFile) -> bytes:
    """A robot's file; what is not told is left out."""
    return msgspec.yaml.encode(_without_nothing(msgspec.to_builtins(told)))


def _without_nothing(value: object) -> object:
    if not isinstance(value, dict):
        return value
    return {key: _without_nothing(part) for key, part in value.items() if part not in (None, {}, False)}
