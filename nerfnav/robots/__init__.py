"""Robots: how flat outputs become motion, how actions move the state, and what the body is made of."""

from nerfnav.registry import Registry
from nerfnav.robots.couch import Couch
from nerfnav.robots.diffdrive import DiffDrive
from nerfnav.robots.quadrotor import Quadrotor
from nerfnav.robots.robot import Robot

ROBOTS: Registry[type[Robot]] = Registry("robot", (Quadrotor, Couch, DiffDrive))
"""Name to robot."""


def names() -> tuple[str, ...]:
    """What `load` knows."""
    return tuple(ROBOTS)


def load(name: str) -> Robot:
    """The robot of that name with its default constants; raises UnknownNameError that lists the known ones."""
    return ROBOTS[name]()


def register(robot: type[Robot]) -> None:
    """Make a class of robots, which needs no arguments, known by its name. Raises NameTakenError for a taken one."""
    ROBOTS.register(robot)
