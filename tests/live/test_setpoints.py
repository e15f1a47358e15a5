"""Setpoints of discrete motions."""

import numpy as np
import pytest
import torch

from nerfnav.core.steps import run_steps
from nerfnav.live.answer import OLDEST_S, Answer, Guidance, Order
from nerfnav.live.setpoints import (
    GuidedVehicle,
    compute_guided_action,
    knots,
    predict_guided,
    setpoints_of,
    shift_half_step_back,
)
from nerfnav.planner import PlanProblem, plan_fast
from nerfnav.robots import Motion, Quadrotor, RigidState
from tests.planner.halls import Building, field_of

ROBOT, H = Quadrotor(), 0.1


@pytest.fixture(scope="module")
def guidance() -> Guidance:
    """Through an empty room, from a start that moves."""
    field = field_of(Building((3.0, 2.0, 2.0), ()), 0.05)
    begun = RigidState.at_rest((0.5, 1.0, 1.0))
    start = RigidState(begun.position, torch.tensor([0.8, 0.2, 0.0]), begun.rotation, begun.body_rate)
    goal = RigidState.at_rest((2.4, 1.3, 1.2), 0.7)
    motion = run_steps(plan_fast(PlanProblem(field, ROBOT, shift_half_step_back(start, H), goal, 20, H))).motion
    return Guidance(Order.FOLLOW, "", setpoints_of(motion, 5.0))


def test_the_curve_passes_through_the_state_that_it_was_planned_from(guidance: Guidance) -> None:
    first = guidance.setpoints[0]
    assert first.time == 5.0
    assert first.velocity == pytest.approx((0.8, 0.2, 0.0), abs=1e-4)
    assert first.position == pytest.approx((0.5, 1.0, 1.0), abs=0.01)


def test_it_ends_at_rest_at_the_goal(guidance: Guidance) -> None:
    last = guidance.setpoints[-1]
    assert last.position == pytest.approx((2.4, 1.3, 1.2), abs=1e-5) and last.yaw == pytest.approx(0.7, abs=1e-5)
    assert last.velocity == last.acceleration == pytest.approx((0, 0, 0), abs=1e-9)
    after = guidance.at(100.0)
    assert after is not None and after.position == last.position


def test_velocity_and_acceleration_are_derivatives_everywhere(guidance: Guidance) -> None:
    step, times = 1e-4, np.linspace(5.001, guidance.setpoints[-1].time - 0.001, 97)
    for time in times:
        before, here, after = (guidance.at(time + offset) for offset in (-step, 0, step))
        assert before is not None and here is not None and after is not None
        slope = (np.array(after.position) - before.position) / (2 * step)
        np.testing.assert_allclose(here.velocity, slope, atol=1e-4)
        slope = (np.array(after.velocity) - before.velocity) / (2 * step)
        np.testing.assert_allclose(here.acceleration, slope, atol=0.02)


def test_the_knots_are_those_of_a_cubic_b_spline() -> None:
    states = RigidState.stack([RigidState.at_rest((x, 0.0, 0.0)) for x in (0.0, 0.1, 0.4, 0.5, 0.5)])
    table = knots(Motion(states, torch.zeros(4, 4), H))
    np.testing.assert_allclose(table[2, :, 0], [(0.1 + 4 * 0.4 + 0.5) / 6, 0.4 / 0.2, -0.2 / 0.01], rtol=1e-5)
    np.testing.assert_allclose(table[0, 2, 0], table[1, 2, 0], rtol=1e-5)
    np.testing.assert_allclose(table[-1, :, 0], [0.5, 0, 0], atol=1e-6)


def test_a_vehicle_that_follows_is_predicted_exactly(guidance: Guidance) -> None:
    for start, end in ((5.1, 5.2), (5.33, 5.37), (5.5, 6.0)):
        before, after = predict_guided(guidance, start, True), predict_guided(guidance, end, True)
        action = compute_guided_action(guidance, start, end, flies=True)
        assert before is not None and after is not None and action is not None
        np.testing.assert_allclose(
            GuidedVehicle().step(before, action, end - start).local(after), torch.zeros(12), atol=2e-5
        )
        thrust = torch.tensor([0.0, 0.0, 9.81]) + torch.tensor(guidance.at(start).acceleration)  # pyright: ignore
        np.testing.assert_allclose(before.rotation[:, 2], thrust / thrust.norm(), atol=1e-5)


def test_one_that_holds_is_predicted_to_go_on() -> None:
    assert (
        compute_guided_action(Guidance(Order.HOLD, ""), 0.0, 1.0, True) is None
        and compute_guided_action(None, 0.0, 1.0, True) is None
    )
    state = RigidState(torch.zeros(3), torch.tensor([1.0, 0, 0]), torch.eye(3), torch.tensor([0, 0, 0.5]))
    moved = GuidedVehicle().step(state, GuidedVehicle().hold(state, 0.1), 0.1)
    np.testing.assert_allclose(moved.position, [0.1, 0, 0])
    np.testing.assert_allclose(moved.body_rate, [0, 0, 0.5])


def test_an_answer_that_comes_too_late_is_not_followed(guidance: Guidance) -> None:
    begun = guidance.setpoints[0].time
    answer = Answer(begun, "followed", "", guidance=guidance)
    assert answer.guidance_at(begun + 0.9 * OLDEST_S) is guidance
    late = answer.guidance_at(begun + 1.5)
    assert late is not None and late.order is Order.HOLD and late.setpoints == () and "1.50 s" in late.reason
    assert Answer(begun, "followed", "").guidance_at(begun + 9) is None
