"""Robots: how flat outputs become motion, how actions move the state, and what the body is made of."""

from collections.abc import Callable
from functools import partial

from nerfnav.errors import UnknownNameError
from nerfnav.robots.couch import Couch
from nerfnav.robots.diffdrive import DiffDrive
from nerfnav.robots.quadrotor import Quadrotor
from nerfnav.robots.robot import Robot
from nerfnav.robots.rooms import CART, QUADROTOR_25, SOFA

_ROBOTS: dict[str, Callable[[], Robot]] = {
    "quadrotor": Quadrotor,
    "couch": Couch,
    "diffdrive": DiffDrive,
    QUADROTOR_25.name: partial(Quadrotor, QUADROTOR_25),
    SOFA.name: partial(Couch, SOFA),
    CART.name: partial(DiffDrive, CART),
}


def names() -> tuple[str, ...]:
    """What `load` knows."""
    return tuple(_ROBOTS)


def load(name: str) -> Robot:
    """The robot of that name with its default constants; raises UnknownNameError that lists the known ones."""
    if name not in _ROBOTS:
        raise UnknownNameError("robot", name, _ROBOTS)
    return _ROBOTS[name]()
