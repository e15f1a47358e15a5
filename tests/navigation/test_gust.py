"""Gusts, scaled to the robot and its clearance."""

import pytest
import torch

from nerfnav import robots
from nerfnav.navigation.gust import GustStrength, fit_gust
from nerfnav.navigation.physical.simulator import PhysicalSimulator
from nerfnav.navigation.physical.worlds import make_physical_simulator
from nerfnav.robots import Motion, RigidState
from tests.navigation.doubles import ROBOT, START, draws, simulator

LARGEST = GustStrength(0.05, 0.3, 0.04, 0.2)
HOVER = torch.tensor([[ROBOT.weight, 0.0, 0.0, 0.0]])


@pytest.mark.parametrize("name", ["quadrotor", "crazyflie", "diffdrive", "turtlebot3", "couch"])
@pytest.mark.parametrize("clearance", [0.003, 0.03, 0.1, 0.3, 3.0])
def test_a_gust_takes_a_fifth_at_most_of_what_the_robot_recovers_from(name: str, clearance: float) -> None:
    robot = robots.load(name)
    gust = fit_gust(LARGEST, robot, clearance)
    assert gust.velocity_mps <= 0.2 * (2 * robot.deceleration * clearance) ** 0.5 * (1 + 1e-6)
    assert gust.position_m <= 0.2 * clearance * (1 + 1e-6)
    factor = gust.velocity_mps / LARGEST.velocity_mps
    assert gust == LARGEST.scaled(factor) and 0 < factor <= 1


def test_there_is_no_gust_without_clearance_and_the_largest_one_with_much() -> None:
    assert fit_gust(LARGEST, ROBOT, 0.0) == LARGEST.scaled(0.0)
    assert fit_gust(LARGEST, ROBOT, 1.0) == LARGEST


def test_robots_decelerate_as_their_limits_allow() -> None:
    assert robots.load("quadrotor").deceleration == 4.0
    assert robots.load("couch").deceleration == 15.0
    assert robots.load("diffdrive").deceleration == robots.load("diffdrive").most("acceleration")


def test_a_gust_is_exactly_as_strong_as_it_says_in_any_direction() -> None:
    draw = draws(0)
    changes = torch.stack([LARGEST.sample(draw).unflatten(0, (4, 3)) for _ in range(400)])
    sizes = torch.tensor([0.05, 0.3, 0.04, 0.2])
    torch.testing.assert_close(changes.norm(dim=-1), sizes.expand(400, 4))
    assert (changes.mean(0).norm(dim=-1) < 0.15 * sizes).all()


@pytest.mark.parametrize("physical", [False, True])
def test_both_worlds_take_a_gust_as_strong_as_it_is(physical: bool) -> None:
    plan, speeds = Motion(RigidState.stack([START, START]), HOVER, 0.1), []
    for gust in (None, GustStrength(0.0, 0.2, 0.0, 0.0)):
        world = simulator(noise=None)
        world = make_physical_simulator(world) if physical else world
        assert isinstance(world, PhysicalSimulator) is physical
        world.follow(plan, gust)
        speeds.append(world.state.velocity)
    assert (speeds[1] - speeds[0]).norm() == pytest.approx(0.2, abs=1e-5)
