"""The terms of Eq. 2, one by one."""

import math

import pytest
import torch

from nerfnav.field.core.protocol import Field
from nerfnav.geometry import so3
from nerfnav.planner import terms
from nerfnav.planner.risk.costs import CostWeights, collision_per_step, collision_probability_bound, control
from nerfnav.planner.terms.term import Evaluated, TermContext, evaluate
from nerfnav.robots.body import Body
from nerfnav.robots.state import Motion, RigidState
from tests.planner.places import BOX, ROBOT, Fog, Wall, ball, straight_motion


def terms_of(field: Field, motion: Motion, weights: CostWeights | None = None) -> Evaluated:
    return evaluate(terms.list_terms(), TermContext(field, ROBOT, weights or CostWeights()), motion)


def test_in_uniform_fog_every_body_point_pays_for_its_way():
    motion = straight_motion((-0.5, 0, 0.5), (0.5, 0, 0.5), steps=10)
    met = collision_per_step(Fog(rho=2.0), motion, ROBOT.body)
    torch.testing.assert_close(met, torch.full((10,), 2.0 * 0.1 * 50))


@pytest.mark.parametrize("samples", [1, 2, 5])
def test_the_number_of_samples_does_not_change_what_uniform_fog_costs(samples: int):
    motion = straight_motion((-0.5, 0, 0.5), (0.5, 0.2, 0.5))
    one, many = (collision_per_step(Fog(), motion, ROBOT.body, n) for n in (1, samples))
    torch.testing.assert_close(one, many)


def test_turning_on_the_spot_moves_the_corners_and_costs():
    turned = so3.from_yaw(torch.linspace(0, 1, 11))
    place, still = torch.tensor([0.0, 0, 0.5]).expand(11, 3), torch.zeros(11, 3)
    motion = Motion(RigidState(place, still, turned, still), torch.zeros(10, 4), 0.1)
    corner = Body((0.1, 0.1, 0.04), torch.tensor([[0.05, 0.05, 0.0]]))
    chord = 2 * math.hypot(0.05, 0.05) * math.sin(0.05)
    torch.testing.assert_close(collision_per_step(Fog(rho=3.0), motion, corner), torch.full((10,), 3 * chord))


def test_the_density_is_not_squared():
    motion = straight_motion((-0.5, 0, 0.5), (0.5, 0, 0.5))
    once, twice = (collision_per_step(Fog(rho=rho), motion, ROBOT.body).sum() for rho in (1.0, 2.0))
    torch.testing.assert_close(twice, 2 * once)


def test_a_thin_wall_between_two_waypoints_is_only_seen_with_more_samples():
    motion = straight_motion((-0.15, 0, 0.5), (0.15, 0, 0.5), steps=1)
    point = Body((0.01, 0.01, 0.01), torch.zeros(1, 3))
    wall = Wall(door=0.0, thickness=0.04)
    shifted = straight_motion((-0.08, 0, 0.5), (0.22, 0, 0.5), steps=1)
    assert collision_per_step(wall, motion, point, 1).item() > 1  # its middle happens to be the wall
    assert collision_per_step(wall, shifted, point, 1).item() < 0.5
    assert collision_per_step(wall, shifted, point, 8).item() > 1


def test_body_points_turn_and_move_with_the_body():
    states = RigidState.stack([RigidState.at_rest((1, 2, 3), math.pi / 2)])
    body = Body((0.2, 0.2, 0.2), torch.tensor([[0.1, 0.0, 0.05]]))
    points = body.points_at(states)
    torch.testing.assert_close(points, torch.tensor([[[1.0, 2.1, 3.05]]]))


def test_the_control_cost_is_a_weighted_sum_of_squares():
    motion = straight_motion((0, 0, 0.5), (0, 0, 0.5), steps=3)
    actions = torch.tensor([[1.0, 2, 0, 0], [0, 0, 3, 0], [0, 0, 0, 4]])
    motion = Motion(motion.states, actions, 0.1)
    assert control(motion, torch.tensor([1.0, 10, 100, 1000])).item() == 1 + 40 + 900 + 16000


def test_hovering_for_a_step_costs_1():
    motion = straight_motion((0, 0, 0.5), (0, 0, 0.5), steps=5)
    hover = Motion(motion.states, torch.tensor([ROBOT.weight, 0, 0, 0]).expand(5, 4), 0.1)
    torch.testing.assert_close(control(hover, torch.tensor(ROBOT.action_weights)), torch.tensor(5.0))


def test_terms_are_differentiable_in_the_motion():
    positions = torch.tensor([[-0.3, 0.0, 0.4], [-0.2, 0.01, 0.42], [-0.1, 0.0, 0.4]], dtype=torch.float64)
    field = ball().__class__(BOX.to(torch.float64), torch.tensor([[0.0, 0.0, 0.4]], dtype=torch.float64),
                             torch.tensor([0.25], dtype=torch.float64), softness=0.1)  # fmt: skip
    actions = torch.rand(2, 4, generator=torch.Generator().manual_seed(0), dtype=torch.float64)

    def all_terms(p: torch.Tensor, theta: torch.Tensor, u: torch.Tensor) -> torch.Tensor:
        motion = Motion(RigidState(p, torch.zeros_like(p), so3.exp(theta), torch.zeros_like(p)), u, 0.1)
        found = terms_of(field, motion)
        return torch.stack([*found.values.values(), found.total])

    theta = 0.1 * torch.arange(9, dtype=torch.float64).reshape(3, 3)
    inputs = (positions.requires_grad_(), theta.requires_grad_(), actions.requires_grad_())
    assert torch.autograd.gradcheck(all_terms, inputs, eps=1e-7, atol=1e-4, rtol=1e-4)


def test_standing_still_has_a_finite_gradient():
    positions = torch.zeros(3, 3, requires_grad=True)
    states = RigidState(positions, positions.detach(), torch.eye(3).expand(3, 3, 3), positions.detach())
    collision_per_step(ball(), Motion(states, torch.zeros(2, 4), 0.1), ROBOT.body).sum().backward()
    assert positions.grad is not None and torch.isfinite(positions.grad).all()


def test_a_batch_of_motions_has_a_batch_of_costs():
    ends = [(0.5, 0.0, 0.4), (0.5, 0.5, 0.4), (-0.5, 0.6, 0.2)]
    motions = [straight_motion((-0.5, 0, 0.4), end) for end in ends]
    batch = Motion(RigidState.stack([m.states for m in motions]), torch.stack([m.actions for m in motions]), 0.1)
    found = terms_of(ball(), batch)
    assert found.total.shape == (3,)
    for row, motion in enumerate(motions):
        alone = terms_of(ball(), motion).numbers()
        assert found.total[row].item() == pytest.approx(alone.total, rel=1e-5)


def test_the_bound_is_the_unweighted_collision_sum_and_at_most_1():
    along, through = (straight_motion((-0.5, y, 0.4), (0.5, y, 0.4)) for y in (0.38, 0.0))
    bound = collision_probability_bound(ball(), along, ROBOT.body)
    assert 0 < bound < 1
    assert bound == pytest.approx(collision_per_step(ball(), along, ROBOT.body, 20).sum().item(), rel=0.001)
    assert collision_probability_bound(ball(), through, ROBOT.body) == 1


def test_the_bound_holds_for_a_point_that_flies_through_fog():
    # exactly: 1 - exp(-rho * distance)
    point = Body((0.01, 0.01, 0.01), torch.zeros(1, 3))
    motion = straight_motion((-0.5, 0, 0.5), (0.5, 0, 0.5))
    for rho in (0.01, 0.1, 0.5):
        bound = collision_probability_bound(Fog(rho=rho), motion, point)
        assert 1 - math.exp(-rho) <= bound <= 1.5 * (1 - math.exp(-rho))


def test_every_weight_scales_its_term():
    motion = straight_motion((-0.5, 0.2, 0.4), (0.5, 0.2, 1.4))
    plain = terms_of(ball(), motion).numbers()
    heavy = terms_of(ball(), motion, CostWeights(2.0, 0.3, 400.0, 4000.0)).numbers()
    assert heavy.collision == pytest.approx(2 * plain.collision)
    assert heavy.control == pytest.approx(3 * plain.control)
    assert heavy.limits == pytest.approx(4 * plain.limits)
    assert plain.total == plain.collision + plain.control + plain.limits
