"""Registry of robots by name, and their description as files."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import msgspec

from nerfnav.core.registry import Registry
from nerfnav.robots.body_file import BodyFile
from nerfnav.robots.couch import Couch
from nerfnav.robots.diffdrive import DiffDrive
from nerfnav.robots.handheld import HandHeld
from nerfnav.robots.quadrotor import Quadrotor
from nerfnav.robots.robot import CAMERA, Robot
from nerfnav.robots.robot_file import (
    LIMITS,
    SUFFIXES,
    CameraFile,
    Kind,
    RobotFile,
    decode_robot_file,
    read_robot,
    robot_of,
)

BUNDLED = Path(__file__).with_name("bundled")
"""Folder of the robots that come with nerfnav as files."""


@dataclass(frozen=True)
class RobotEntry:
    """Robot that users choose by name."""

    name: str
    """Name, as in `--robot`."""
    make: Callable[[], Robot]
    """Constructor with its default constants."""
    plans: bool = True
    """True if it can be planned for; else it is tracked only, and no choice where plans are made."""


def _bundled(name: str) -> RobotEntry:
    return RobotEntry(name, partial(read_robot, BUNDLED / f"{name}.yaml"))


ROBOTS: Registry[RobotEntry] = Registry(
    "robot",
    (
        RobotEntry("quadrotor", Quadrotor),
        RobotEntry("couch", Couch),
        RobotEntry("diffdrive", DiffDrive),
        RobotEntry("handheld", HandHeld, plans=False),
        *map(_bundled, ("quadrotor25", "sofa", "cart", "crazyflie", "x500", "turtlebot3")),
    ),
)
"""Robots by name."""


def names() -> tuple[str, ...]:
    """List the robots that `load` knows by name and planners can plan for."""
    return tuple(name for name, entry in ROBOTS.items() if entry.plans)


def load(name: str) -> Robot:
    """Load the robot of a name with its default constants, or that of a file whose path ends with .yaml.

    Raises UnknownNameError that lists the known names, and InvalidInputError for a file that describes no robot.
    """
    if not is_file(name):
        return ROBOTS[name].make()
    robot = read_robot(Path(name))
    robot.file = Path(name).resolve()
    return robot


def is_file(name: str) -> bool:
    """Return True if a name ends as robots' files do and is not registered."""
    return name not in ROBOTS and Path(name).suffix.lower() in SUFFIXES


def is_known(name: str) -> bool:
    """Return True if `load` finds a robot of that name, or the file."""
    return Path(name).is_file() if is_file(name) else name in ROBOTS


def register(entry: RobotEntry) -> None:
    """Add a robot. Raises NameTakenError where another one has its name."""
    ROBOTS.register(entry)


WITH_MASS = ("quadrotor", "couch")
"""Kinds of robots that have a mass."""


def describe_robot(name: str) -> tuple[RobotFile, Path]:
    """Describe a robot, a name or a file as `load` knows it, as a file; also return the folder of its meshes.

Mass, inertia, limits and camera that its file leaves out are filled in. Raises as `load` does.
    """
    robot = load(name)
    file = Path(name) if is_file(name) else BUNDLED / f"{name}.yaml"
    if file.is_file():
        entry = decode_robot_file(file)
    else:
        config = robot.config  # type: ignore[attr-defined]
        box = BodyFile(box=config.extents, points=config.point_counts)
        entry = RobotFile(name=robot.name, kind=robot.name, body=box)  # type: ignore[arg-type]
    return _completed(entry, robot), file.parent


def change_kind(entry: RobotFile, kind: Kind, folder: Path) -> RobotFile:
    """Change the kind of a robot: it keeps body, camera and, where both kinds have one, mass. Meshes lie in `folder`.

All other constants are the bundled robot's, at this size and mass (see robots/robot_file.py). Raises
    InvalidInputError for an impossible robot.
    """
    mass = None
    if kind in WITH_MASS:
        mass = load(kind).config.mass if entry.mass is None else entry.mass  # type: ignore[attr-defined]
    plain = msgspec.structs.replace(entry, kind=kind, mass=mass, inertia=None, limits={})
    return _completed(plain, robot_of(plain, folder))


def _completed(entry: RobotFile, robot: Robot) -> RobotFile:
    """Fill in the numbers of the robot that the file left out."""
    config, mass, inertia = getattr(robot, "config", None), entry.mass, entry.inertia
    camera = entry.camera or CameraFile()
    limits = {limit: getattr(config, attribute) for limit, attribute in LIMITS[entry.kind].items()} or entry.limits
    if entry.kind in WITH_MASS:
        mass = getattr(config, "mass", mass)
    if entry.kind == "quadrotor":
        inertia = getattr(config, "inertia", inertia)
    if camera.file is None:
        width, height = camera.width or CAMERA.width, camera.height or CAMERA.height
        camera = msgspec.structs.replace(camera, width=width, height=height)
    return msgspec.structs.replace(entry, mass=mass, inertia=inertia, limits=limits, camera=camera)


def to_yaml(entry: RobotFile) -> bytes:
    """Encode a robot's file as YAML; entries that are not given are left out."""
    return msgspec.yaml.encode(_without_nothing(msgspec.to_builtins(entry)))


def _without_nothing(value: object) -> object:
    if not isinstance(value, dict):
        return value
    return {key: _without_nothing(part) for key, part in value.items() if part not in (None, {}, False)}
