"""Robots: how flat outputs become motion, how actions move the state, and what the body is made of."""

from nerfnav.errors import UnknownNameError
from nerfnav.robots.couch import Couch
from nerfnav.robots.diffdrive import DiffDrive
from nerfnav.robots.quadrotor import Quadrotor
from nerfnav.robots.robot import Robot

_ROBOTS: dict[str, type[Robot]] = {robot.name: robot for robot in (Quadrotor, Couch, DiffDrive)}


def names() -> tuple[str, ...]:
    """What `load` knows."""
    return tuple(_ROBOTS)


def load(name: str) -> Robot:
    """The robot of that name with its default constants; raises UnknownNameError that lists the known ones."""
    if name not in _ROBOTS:
        raise UnknownNameError("robot", name, _ROBOTS)
    return _ROBOTS[name]()
