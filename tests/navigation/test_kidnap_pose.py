"""Kidnapping: poses of kidnapped robots, and their motion."""

import pytest
import torch

from nerfnav.geometry import so3
from nerfnav.geometry.box import Box
from nerfnav.geometry.camera import Pose
from nerfnav.navigation.simulator import KidnapConfig, sample_kidnap_pose
from nerfnav.robots.couch import Couch
from nerfnav.robots.state import RigidState
from tests.navigation.doubles import draws, simulator

BOX = Box.of((-2, -2, 0), (2, 2, 1))
HERE = RigidState.at_rest((0.1, 0.2, 0.5), 0.3)
CONFIG = KidnapConfig()


@pytest.mark.parametrize("seed", range(8))
def test_a_robot_is_put_down_near_where_it_fits(seed: int) -> None:
    def fits(state: RigidState) -> bool:
        return bool(state.position[0] > 0.3)

    pose = sample_kidnap_pose(HERE, BOX, fits, draws(seed))
    assert pose is not None and pose.position[0] > 0.3 and BOX.contains(pose.position)
    assert CONFIG.nearest <= (pose.position - HERE.position).norm() <= CONFIG.farthest + CONFIG.rise
    turned = so3.local(HERE.rotation, pose.rotation)
    assert turned[2].abs() <= CONFIG.turn and turned[:2].norm() < 1e-6


def test_where_it_fits_nowhere_near_it_is_kidnapped_farther() -> None:
    def fits(state: RigidState) -> bool:
        return bool((state.position - HERE.position).norm() > 1.5)

    pose = sample_kidnap_pose(HERE, BOX, fits, draws(0))
    assert pose is not None and fits(RigidState(pose.position, torch.zeros(3), pose.rotation, torch.zeros(3)))


def test_where_it_fits_nowhere_it_is_not_kidnapped() -> None:
    assert sample_kidnap_pose(HERE, BOX, lambda _: False, draws(0), KidnapConfig(tries=5)) is None


def test_a_robot_that_is_kidnapped_moves_on_in_its_own_axes() -> None:
    world = simulator()
    world.state = HERE.retract(torch.tensor([0.0] * 3 + [0.4, 0.1, 0.2] + [0.1, 0.2, 0.3] + [0.1, 0.0, 0.5]))
    before = world.state
    turn = so3.from_yaw(torch.tensor(1.2)) @ before.rotation
    world.kidnap(Pose(turn, torch.tensor([0.5, -0.5, 0.4])))
    assert torch.equal(world.state.position, torch.tensor([0.5, -0.5, 0.4]))
    torch.testing.assert_close(world.state.rotation.T @ world.state.velocity, before.rotation.T @ before.velocity)
    assert torch.equal(world.state.body_rate, before.body_rate)


def test_a_robot_on_the_ground_is_put_down_on_it() -> None:
    world = simulator()
    world.robot, world.state = Couch(), RigidState.at_rest((0.0, 0.0, 0.1))
    world.kidnap(Pose(so3.from_yaw(torch.tensor(0.5)), torch.tensor([0.6, 0.1, 0.4])))
    assert world.state.position[2] == pytest.approx(0.1)
    assert so3.yaw_of(world.state.rotation).item() == pytest.approx(0.5)
