"""States on their manifold."""

import pytest
import torch

from nerfnav.geometry import so3
from nerfnav.robots.state import ATTITUDE, BODY_RATE, POSITION, TANGENT, VELOCITY, RigidState


def random_state(*batch: int, seed: int = 0) -> RigidState:
    generator = torch.Generator().manual_seed(seed)
    p, v, theta, w = torch.randn(4, *batch, 3, generator=generator, dtype=torch.float64)
    return RigidState(p, v, so3.exp(theta), w)


@pytest.mark.parametrize("batch", [(), (4,), (2, 3)])
def test_local_undoes_retract(batch: tuple[int, ...]):
    state = random_state(*batch)
    tangent = torch.randn(*batch, TANGENT, generator=torch.Generator().manual_seed(1), dtype=torch.float64) * 0.5
    torch.testing.assert_close(state.local(state.retract(tangent)), tangent)


def test_a_state_is_no_distance_from_itself():
    state = random_state(5)
    torch.testing.assert_close(state.local(state), torch.zeros(5, 12, dtype=torch.float64))


def test_the_parts_of_a_tangent_move_the_parts_of_a_state():
    state = random_state()
    step = torch.arange(1.0, 13.0, dtype=torch.float64) / 20
    moved = state.retract(step)
    torch.testing.assert_close(moved.position, state.position + step[POSITION])
    torch.testing.assert_close(moved.velocity, state.velocity + step[VELOCITY])
    torch.testing.assert_close(moved.rotation, state.rotation @ torch.linalg.matrix_exp(so3.hat(step[ATTITUDE])))
    torch.testing.assert_close(moved.body_rate, state.body_rate + step[BODY_RATE])


@pytest.mark.parametrize("batch", [(), (4,), (2, 3)])
def test_bodies_that_are_moved_each_to_its_own_pose_move_on_in_their_own_axes(batch: tuple[int, ...]) -> None:
    before, there = random_state(*batch), random_state(*batch, seed=1)
    moved = before.moved_to(there.pose)
    velocities_body = [(one.rotation.mT @ one.velocity[..., None])[..., 0] for one in (before, moved)]
    torch.testing.assert_close(velocities_body[1], velocities_body[0])
    assert torch.equal(moved.pose.position, there.position) and torch.equal(moved.body_rate, before.body_rate)
    torch.testing.assert_close(moved.moved_to(before.pose).velocity, before.velocity)


def test_at_rest_is_level_still_and_heads_where_asked():
    state = RigidState.at_rest((1, 2, 3), 0.5)
    assert state.position.tolist() == [1, 2, 3]
    assert not state.velocity.any() and not state.body_rate.any()
    torch.testing.assert_close(so3.yaw_of(state.rotation), torch.tensor(0.5))
    torch.testing.assert_close(state.rotation[:, 2], torch.tensor([0.0, 0.0, 1.0]))
    torch.testing.assert_close(state.pose.rotation, state.rotation)
