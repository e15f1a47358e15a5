"""A camera in a hand: it moves on, and is never planned for."""

from pathlib import Path

import pytest
import torch

from nerfnav import robots
from nerfnav.core.errors import InvalidInputError
from nerfnav.robots import HandHeld, RandomAcceleration, RigidState


def test_it_keeps_its_velocities() -> None:
    state = RigidState.at_rest((1.0, 2.0, 3.0)).retract(torch.tensor([0, 0, 0, 0.5, 0, 0, 0, 0, 0, 0, 0, 0.3]).float())
    after = HandHeld().step(state, torch.zeros(0), 0.2)
    assert after.position.tolist() == pytest.approx([1.1, 2.0, 3.0])
    assert torch.equal(after.velocity, state.velocity) and torch.equal(after.body_rate, state.body_rate)


def test_it_is_known_by_name_but_no_choice_for_plans() -> None:
    robot = robots.load("handheld")
    assert "handheld" not in robots.names() and robots.is_known("handheld")
    state = RigidState.at_rest((0.0, 0.0, 0.0))
    with pytest.raises(InvalidInputError, match="tracked, not planned for"):
        robot.check_ends(state, state)


def test_a_file_may_describe_one_with_its_camera(tmp_path: Path) -> None:
    path = tmp_path / "phone.yaml"
    path.write_text("name: phone\nkind: handheld\nbody: {box: [0.1, 0.1, 0.1]}\ncamera: {width: 64, height: 48}\n")
    robot = robots.load(str(path))
    assert robot.name == "phone" and (robot.camera.width, robot.camera.height) == (64, 48)


def test_random_acceleration_adds_as_much_in_two_steps_as_in_one_of_their_sum() -> None:
    def after(dt: float) -> torch.Tensor:
        move = torch.eye(12)
        move[0:3, 3:6] = move[6:9, 9:12] = dt * torch.eye(3)
        return move

    first, second, whole = (RandomAcceleration(dt, 0.4, 0.6).covariance() for dt in (0.1, 0.3, 0.4))
    assert torch.allclose(after(0.3) @ first @ after(0.3).T + second, whole, atol=1e-7)
