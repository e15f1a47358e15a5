"""Compiled flatness maps against their robots' torch maps."""

import numpy as np
import pytest
import torch

from nerfnav.robots.flat_map import TorchFlatMap
from nerfnav.robots.maps import flat_map
from nerfnav.robots.quadrotor import Quadrotor
from nerfnav.robots.quadrotor_map import QuadrotorMap
from nerfnav.robots.state import RigidState

STEPS, DT = 12, 0.1


def ends() -> tuple[RigidState, RigidState]:
    """Two states that move and tumble."""
    generator = torch.Generator().manual_seed(0)
    states = [RigidState.at_rest((0.0, 0.0, 0.5), 0.4), RigidState.at_rest((0.8, 0.5, 0.3), -2.0)]
    first, second = (state.retract(0.2 * torch.randn(12, generator=generator)) for state in states)
    return first, second


def free_numbers(spread: float) -> np.ndarray:
    """Free numbers of a flight between the ends, more or less disturbed."""
    start, goal = ends()
    share = torch.linspace(0, 1, STEPS + 1)[:, None]
    positions = (1 - share) * start.position + share * goal.position
    free = Quadrotor().encode(torch.cat([positions, -share], -1), start, goal, DT).double().numpy()
    return free + spread * np.random.default_rng(1).standard_normal(free.shape)


def both() -> tuple[QuadrotorMap, TorchFlatMap]:
    robot = Quadrotor()
    compiled = flat_map(robot, *ends(), STEPS, DT)
    assert isinstance(compiled, QuadrotorMap)
    return compiled, TorchFlatMap(robot, *ends(), STEPS, DT)


@pytest.mark.parametrize("spread", [0.0, 0.05, 0.5, 3.0])  # the last one tumbles through every attitude
def test_the_compiled_motion_is_that_of_torch(spread: float):
    compiled, reference = both()
    for flat in (compiled, reference):
        flat.forward(free_numbers(spread))
    for name in ("position", "velocity", "rotation", "rate", "action"):
        np.testing.assert_allclose(getattr(compiled, name), getattr(reference, name), rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("spread", [0.0, 0.05, 0.5, 3.0])
def test_the_compiled_adjoint_is_autograd(spread: float):
    generator = np.random.default_rng(2)
    by_position, by_rotation = generator.standard_normal((2, STEPS + 1, 3))
    by_action = generator.standard_normal((STEPS, 4))
    gradients = []
    for flat in both():
        flat.forward(free_numbers(spread))
        gradients.append(flat.backward(by_position.copy(), by_rotation.copy(), by_action.copy()))
    np.testing.assert_allclose(gradients[0], gradients[1], rtol=1e-6, atol=1e-6 * np.abs(gradients[1]).max())


@pytest.mark.parametrize("spread", [0.05, 3.0])
def test_the_compiled_limits_and_their_derivatives_are_those_of_torch(spread: float):
    costs, slopes = [], []
    for flat in both():
        flat.forward(free_numbers(spread))
        costs.append(flat.limits(3.0))
        nothing = np.zeros((STEPS + 1, 3))
        slopes.append(flat.backward(nothing.copy(), nothing.copy(), np.zeros((STEPS, 4))))
    assert costs[0] == pytest.approx(costs[1], rel=1e-6)
    np.testing.assert_allclose(slopes[0], slopes[1], rtol=1e-6, atol=1e-6 * np.abs(slopes[1]).max())
    assert costs[0] > 0 or spread < 1


def test_free_fall_and_hover_stay_finite():
    robot = Quadrotor()
    start = goal = RigidState.at_rest((0.0, 0.0, 0.5))
    hover = np.concatenate([[robot.weight] * 2, np.tile([0.0, 0.0, 0.5], STEPS - 4), np.zeros(STEPS - 2)])
    fall = hover.copy()
    heights = 0.5 - 0.5 * robot.config.gravity * (np.arange(4, STEPS) * DT) ** 2
    fall[2 + 2 : 2 + 3 * (STEPS - 4) : 3] = heights
    for free in (hover, fall):
        flat = flat_map(robot, start, goal, STEPS, DT)
        flat.forward(free)
        gradient = flat.backward(np.ones((STEPS + 1, 3)), np.ones((STEPS + 1, 3)), np.ones((STEPS, 4)))
        assert np.isfinite(flat.action).all() and np.isfinite(gradient).all()


def test_a_half_turn_of_the_heading_has_finite_derivatives():
    robot = Quadrotor()
    start, goal = RigidState.at_rest((0.0, 0.0, 0.5), 0.0), RigidState.at_rest((0.5, 0.0, 0.5), float(np.pi))
    flat = flat_map(robot, start, goal, 4, DT)
    flat.forward(np.array([robot.weight, robot.weight, 0.0, np.pi]))
    gradient = flat.backward(np.ones((5, 3)), np.ones((5, 3)), np.ones((4, 4)))
    assert np.isfinite(flat.rate).all() and np.isfinite(gradient).all()
