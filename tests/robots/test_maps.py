"""Compiled flatness maps against their robots' torch maps."""

import numpy as np
import pytest

from nerfnav.robots.couch import Couch
from nerfnav.robots.diffdrive import DiffDrive
from nerfnav.robots.flat_map import FlatMap, TorchFlatMap
from nerfnav.robots.maps import flat_map
from nerfnav.robots.quadrotor import Quadrotor
from nerfnav.robots.robot import Robot
from nerfnav.robots.state import RigidState
from tests.robots.motions import DT, EVERY, STEPS, ends, free_numbers

SPREADS = (0.0, 0.05, 0.5, 3.0)
"""How much free numbers are disturbed; with the last, the quadrotor tumbles through every attitude."""
TOLERANCE = {Quadrotor: 1e-6, Couch: 1e-12, DiffDrive: 1e-9}
"""Largest difference, as a share of the largest number."""

each_robot = pytest.mark.parametrize("robot", EVERY.values(), ids=EVERY)
each_spread = pytest.mark.parametrize("spread", SPREADS)


def both(robot: Robot, spread: float) -> tuple[FlatMap, FlatMap]:
    """The compiled map and the one of autograd, at the same free numbers."""
    between = ends(robot)
    compiled, reference = flat_map(robot, *between, STEPS, DT), TorchFlatMap(robot, *between, STEPS, DT)
    assert not isinstance(compiled, TorchFlatMap)
    for flat in (compiled, reference):
        flat.forward(free_numbers(robot, between, spread).numpy())
    return compiled, reference


def assert_near(found: np.ndarray, expected: np.ndarray, tolerance: float) -> None:
    np.testing.assert_allclose(found, expected, rtol=tolerance, atol=tolerance * max(1.0, np.abs(expected).max()))


@each_robot
@each_spread
def test_the_compiled_motion_is_that_of_torch(robot: Robot, spread: float):
    compiled, reference = both(robot, spread)
    for name in ("position", "velocity", "rotation", "rate", "action"):
        assert_near(getattr(compiled, name), getattr(reference, name), TOLERANCE[type(robot)])


@each_robot
@each_spread
def test_the_compiled_adjoint_is_autograd(robot: Robot, spread: float):
    generator = np.random.default_rng(2)
    by_position, by_rotation = generator.standard_normal((2, STEPS + 1, 3))
    by_action = generator.standard_normal((STEPS, len(robot.action_names)))
    found, expected = (
        flat.backward(by_position.copy(), by_rotation.copy(), by_action.copy()) for flat in both(robot, spread)
    )
    assert_near(found, expected, TOLERANCE[type(robot)])


@each_robot
@pytest.mark.parametrize("spread", [0.05, 3.0])
def test_the_compiled_limits_and_their_derivatives_are_those_of_torch(robot: Robot, spread: float):
    costs, slopes = [], []
    for flat in both(robot, spread):
        nothing = np.zeros((STEPS + 1, 3))
        costs.append(flat.limits(3.0))
        slopes.append(flat.backward(nothing.copy(), nothing.copy(), np.zeros((STEPS, len(robot.action_names)))))
    assert costs[0] == pytest.approx(costs[1], rel=1e-6)
    assert_near(slopes[0], slopes[1], TOLERANCE[type(robot)])
    assert costs[0] > 0 or spread < 1


@each_robot
def test_a_map_forgets_the_limits_of_the_motion_before(robot: Robot):
    compiled, reference = both(robot, 3.0)
    compiled.limits(3.0)
    again = free_numbers(robot, ends(robot), 0.05).numpy()
    slopes = []
    for flat in (compiled, reference):
        flat.forward(again)
        ones = np.ones((STEPS + 1, 3))
        slopes.append(flat.backward(ones.copy(), ones.copy(), np.ones((STEPS, len(robot.action_names)))))
    assert_near(slopes[0], slopes[1], TOLERANCE[type(robot)])


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
