"""Which robots have a compiled flatness map; all others get theirs from autograd."""

from nerfnav.robots.flat_map import FlatMap, TorchFlatMap
from nerfnav.robots.quadrotor import Quadrotor
from nerfnav.robots.quadrotor_map import QuadrotorMap
from nerfnav.robots.robot import Robot
from nerfnav.robots.state import RigidState


def flat_map(robot: Robot, start: RigidState, goal: RigidState, steps: int, dt: float) -> FlatMap:
    """The fastest flatness map of `robot` between two states, over `steps` steps of `dt` [s]."""
    if isinstance(robot, Quadrotor):
        return QuadrotorMap(robot, start, goal, steps, dt)
    return TorchFlatMap(robot, start, goal, steps, dt)
