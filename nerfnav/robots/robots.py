"""Registry of robots by name: the paper's in code, all others in files."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from nerfnav.core.registry import Registry
from nerfnav.robots.couch import Couch
from nerfnav.robots.diffdrive import DiffDrive
from nerfnav.robots.handheld import HandHeld
from nerfnav.robots.quadrotor import Quadrotor
from nerfnav.robots.robot import Robot
from nerfnav.robots.robot_file import SUFFIXES, read_robot

BUNDLED = Path(__file__).with_name("bundled")
"""Where the robots lie that come with nerfnav as files."""


@dataclass(frozen=True)
class RobotEntry:
    """A robot, as users choose it by name."""

    name: str
    """What they call it, as in `--robot`."""
    make: Callable[[], Robot]
    """Makes it with its default constants."""
    plans: bool = True
    """Whether it can be planned for; what cannot is tracked only, and no choice where plans are made."""


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
"""Name to robot."""


def names() -> tuple[str, ...]:
    """What `load` knows by name and planners can plan for."""
    return tuple(name for name, entry in ROBOTS.items() if entry.plans)


def load(name: str) -> Robot:
    """The robot of that name with its default constants, or that of a file whose path ends with .yaml.

    Raises UnknownNameError that lists the known names, and InvalidInputError for a file that describes no robot.
    """
    if not is_file(name):
        return ROBOTS[name].make()
    robot = read_robot(Path(name))
    robot.file = Path(name).resolve()
    return robot


def is_file(name: str) -> bool:
    """Whether users mean a robot's file by what they say: a name that ends as those do."""
    return name not in ROBOTS and Path(name).suffix.lower() in SUFFIXES


def known(name: str) -> bool:
    """Whether `load` finds a robot of that name, or the file."""
    return Path(name).is_file() if is_file(name) else name in ROBOTS


def register(entry: RobotEntry) -> None:
    """Make a robot known by its name. Raises NameTakenError where another one has it."""
    ROBOTS.register(entry)
