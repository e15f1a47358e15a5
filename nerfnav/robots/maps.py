"""Which robots have a compiled flatness map; all others get theirs from autograd."""

from typing import Any

from nerfnav.robots.couch import Couch
from nerfnav.robots.couch_map import CouchMap
from nerfnav.robots.diffdrive import DiffDrive
from nerfnav.robots.diffdrive_map import DiffDriveMap
from nerfnav.robots.flat_map import FlatMap, TorchFlatMap
from nerfnav.robots.quadrotor import Quadrotor
from nerfnav.robots.quadrotor_map import QuadrotorMap
from nerfnav.robots.robot import Robot
from nerfnav.robots.state import RigidState

_COMPILED: dict[type[Robot], Any] = {Quadrotor: QuadrotorMap, Couch: CouchMap, DiffDrive: DiffDriveMap}


def flat_map(robot: Robot, start: RigidState, goal: RigidState, steps: int, dt: float) -> FlatMap:
    """The fastest flatness map of `robot` between two states, over `steps` steps of `dt` [s]."""
    return _COMPILED.get(type(robot), TorchFlatMap)(robot, start, goal, steps, dt)
