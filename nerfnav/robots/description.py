"""Describe a robot as a file with all its numbers, change its kind, and write it as YAML."""

from pathlib import Path

import msgspec

from nerfnav.robots.body_file import BodyFile
from nerfnav.robots.robot import CAMERA, Robot
from nerfnav.robots.robot_file import LIMITS, CameraFile, Kind, RobotFile, decode_robot_file, robot_of
from nerfnav.robots.robots import BUNDLED, is_file, load

WITH_MASS = ("quadrotor", "couch")
"""Kinds of robots that have a mass."""


def describe_robot(name: str) -> tuple[RobotFile, Path]:
    """What describes a robot, a name or a file as `load` knows it, and the folder that its meshes lie in.

    Mass, inertia, limits and camera that its file leaves out are told as they come out. Raises as `load` does.
    """
    robot = load(name)
    file = Path(name) if is_file(name) else BUNDLED / f"{name}.yaml"
    if file.is_file():
        told = decode_robot_file(file)
    else:
        config = robot.config  # type: ignore[attr-defined]
        box = BodyFile(box=config.extents, points=config.point_counts)
        told = RobotFile(name=robot.name, kind=robot.name, body=box)  # type: ignore[arg-type]
    return _completed(told, robot), file.parent


def change_kind(told: RobotFile, kind: Kind, folder: Path) -> RobotFile:
    """The same body, camera and, where both kinds have one, mass, moved in another way; meshes lie in `folder`.

    What else this kind needs is the bundled robot's, at this size and mass (see robots/robot_file.py). Raises
    InvalidInputError where there can be no such robot.
    """
    mass = None
    if kind in WITH_MASS:
        mass = load(kind).config.mass if told.mass is None else told.mass  # type: ignore[attr-defined]
    plain = msgspec.structs.replace(told, kind=kind, mass=mass, inertia=None, limits={})
    return _completed(plain, robot_of(plain, folder))


def _completed(told: RobotFile, robot: Robot) -> RobotFile:
    """The same with the numbers of the robot that it describes, which it may have left out."""
    config, mass, inertia, camera = getattr(robot, "config", None), told.mass, told.inertia, told.camera or CameraFile()
    limits = {limit: getattr(config, attribute) for limit, attribute in LIMITS[told.kind].items()} or told.limits
    if told.kind in WITH_MASS:
        mass = getattr(config, "mass", mass)
    if told.kind == "quadrotor":
        inertia = getattr(config, "inertia", inertia)
    if camera.file is None:
        width, height = camera.width or CAMERA.width, camera.height or CAMERA.height
        camera = msgspec.structs.replace(camera, width=width, height=height)
    return msgspec.structs.replace(told, mass=mass, inertia=inertia, limits=limits, camera=camera)


def to_yaml(told: RobotFile) -> bytes:
    """A robot's file; what is not told is left out."""
    return msgspec.yaml.encode(_without_nothing(msgspec.to_builtins(told)))


def _without_nothing(value: object) -> object:
    if not isinstance(value, dict):
        return value
    return {key: _without_nothing(part) for key, part in value.items() if part not in (None, {}, False)}
