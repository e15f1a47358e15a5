"""The controller against references that it can follow, and the dynamics it is simulated with."""

import math

import pytest
import torch

from nerfnav.geometry import so3
from nerfnav.planner.baselines.geometric_controller import Reference, TrackingConfig, attitude_for, control, track
from nerfnav.planner.space.astar import ease
from nerfnav.robots.quadrotor import Quadrotor
from nerfnav.robots.state import RigidState

ROBOT, DT = Quadrotor(), 0.1
START = RigidState.at_rest((0.0, 0.0, 0.5))


def line(goal: tuple[float, float, float], steps: int = 20, yaw: float = 0.0) -> Reference:
    """Eased along a straight line from the start."""
    share = ease(steps)
    goal_ = torch.tensor(goal)
    return Reference(START.position + share[:, None] * (goal_ - START.position), yaw * share, DT)


def test_at_rest_on_its_reference_the_robot_hovers() -> None:
    motion = track(ROBOT, START, line((0.0, 0.0, 0.5)), 10)
    assert torch.allclose(motion.actions, torch.tensor([ROBOT.weight, 0, 0, 0]).expand(10, 4), atol=1e-5)
    assert torch.allclose(motion.states.position, START.position.expand(11, 3), atol=1e-5)


def test_a_smooth_reference_is_followed_to_its_end() -> None:
    reference = line((1.0, 0.6, 0.8), yaw=1.0)
    motion = track(ROBOT, START, reference, 20)
    assert (motion.states.position - reference.position).norm(dim=-1).max() < 0.05
    assert (motion.states.position[-1] - reference.position[-1]).norm() < 0.02
    assert so3.yaw_of(motion.states.rotation[-1]).item() == pytest.approx(1.0, abs=0.05)


def test_the_flown_motion_obeys_the_dynamics_exactly() -> None:
    motion = track(ROBOT, START, line((1.0, -0.6, 0.3)), 20)
    for t, action in enumerate(motion.actions):
        after = ROBOT.step(motion.states[t], action, DT)
        assert torch.equal(after.position, motion.states.position[t + 1])
        assert torch.equal(after.rotation, motion.states.rotation[t + 1])


def test_a_start_off_the_reference_is_drawn_back_to_it() -> None:
    pushed = RigidState.at_rest((0.1, -0.1, 0.45), yaw=0.3)
    motion = track(ROBOT, pushed, line((0.0, 0.0, 0.5), steps=1), 40)
    error = (motion.states.position - START.position).norm(dim=-1)
    assert error[-1] < 0.01
    assert error.max() < 0.2


def test_a_full_turn_takes_the_attitude_error_away_in_one_step() -> None:
    config = TrackingConfig(turn=1.0)
    reference = line((0.5, 0.0, 0.5))
    turned = RigidState.at_rest((0.0, 0.0, 0.5), yaw=0.5)
    first = ROBOT.step(turned, control(ROBOT, turned, reference, 0, config), DT)
    second = ROBOT.step(first, control(ROBOT, first, reference, 1, config), DT)
    assert so3.yaw_of(second.rotation).item() == pytest.approx(0.0, abs=1e-3)


def test_the_robot_does_not_turn_over_to_fall_faster() -> None:
    motion = track(ROBOT, START, Reference(torch.tensor([[0.0, 0, 0.5], [0.0, 0, -9.0]]), torch.zeros(2), DT), 10)
    assert (motion.states.rotation[:, 2, 2] > 0).all()
    assert torch.isfinite(motion.states.position).all()


@pytest.mark.parametrize("yaw", [0.0, 2.0, -3.1])
def test_an_attitude_points_its_thrust_along_the_force_and_its_nose_along_the_heading(yaw: float) -> None:
    force = torch.tensor([0.4, -0.7, 1.9])
    rotation = attitude_for(force, torch.tensor(yaw))
    assert torch.allclose(rotation.T @ rotation, torch.eye(3), atol=1e-6)
    assert torch.linalg.det(rotation).item() == pytest.approx(1.0, abs=1e-5)
    assert torch.allclose(rotation[:, 2], force / force.norm(), atol=1e-6)
    ahead = torch.tensor([math.cos(yaw), math.sin(yaw), 0.0])
    assert rotation[:, 0] @ ahead > 0
    assert (rotation[:, 1] @ ahead).item() == pytest.approx(0.0, abs=1e-6)
