"""What robots have in common."""

import pytest
import torch
from torch import Tensor

from nerfnav import robots
from nerfnav.core.errors import NameTakenError
from nerfnav.robots.robot import Robot
from nerfnav.robots.state import Motion, RigidState


class Statue(Robot):
    """The least a robot can do."""

    name, action_names, action_weights, minimum_steps = "statue", ("none",), (1.0,), 1

    def step(self, state: RigidState, action: Tensor, dt: float) -> RigidState:
        return state

    def hold(self, state: RigidState, dt: float, turn: float = 0.0) -> Tensor:
        return torch.zeros(1)

    def motion(self, free: Tensor, start: RigidState, goal: RigidState, steps: int, dt: float) -> Motion:
        return Motion(RigidState.stack([start] * (steps + 1)), torch.zeros(steps, 1), dt)

    def encode(self, waypoints: Tensor, start: RigidState, goal: RigidState, dt: float) -> Tensor:
        return torch.zeros(0)


def test_a_robot_without_places_to_avoid_has_no_limits_penalty():
    state = RigidState.at_rest((0, 0, 0))
    motion = Statue().motion(torch.zeros(0), state, state, 3, 0.1)
    assert Statue().limits(motion) == 0


def test_a_robot_from_outside_is_known_by_its_name():
    robots.register(robots.RobotEntry("statue", Statue))
    try:
        assert isinstance(robots.load("statue"), Statue) and "statue" in robots.names()
        with pytest.raises(NameTakenError, match="robot named 'quadrotor' already"):
            robots.register(robots.RobotEntry("quadrotor", Statue))
    finally:
        robots.ROBOTS.unregister("statue")
