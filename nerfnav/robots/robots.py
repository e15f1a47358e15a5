"""Robots by name, as users choose them."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from nerfnav.registry import Registry
from nerfnav.robots.couch import Couch
from nerfnav.robots.diffdrive import DiffDrive
from nerfnav.robots.quadrotor import Quadrotor
from nerfnav.robots.robot import Robot
from nerfnav.robots.rooms import CART, QUADROTOR_25, SOFA


@dataclass(frozen=True)
class RobotEntry:
    """A robot, as users choose it by name."""

    name: str
    """What they call it, as in `--robot`."""
    make: Callable[[], Robot]
    """Makes it with its default constants."""


ROBOTS: Registry[RobotEntry] = Registry(
    "robot",
    (
        RobotEntry("quadrotor", Quadrotor),
        RobotEntry("couch", Couch),
        RobotEntry("diffdrive", DiffDrive),
        RobotEntry(QUADROTOR_25.name, partial(Quadrotor, QUADROTOR_25)),
        RobotEntry(SOFA.name, partial(Couch, SOFA)),
        RobotEntry(CART.name, partial(DiffDrive, CART)),
    ),
)
"""Name to robot."""


def names() -> tuple[str, ...]:
    """What `load` knows."""
    return tuple(ROBOTS)


def load(name: str) -> Robot:
    """The robot of that name with its default constants; raises UnknownNameError that lists the known ones."""
    return ROBOTS[name].make()


def register(entry: RobotEntry) -> None:
    """Make a robot known by its name. Raises NameTakenError where another one has it."""
    ROBOTS.register(entry)
