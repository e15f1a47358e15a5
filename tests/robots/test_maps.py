"""Compiled flatness maps against their robots' torch maps."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from nerfnav.robots.couch import Couch
from nerfnav.robots.diffdrive import DiffDrive
from nerfnav.robots.flat_map import FlatMap, TorchFlatMap
from nerfnav.robots.quadrotor import Quadrotor, QuadrotorMap
from nerfnav.robots.robot import Robot
from nerfnav.robots.state import Motion, RigidState
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
    compiled, reference = robot.flat_map(*between, STEPS, DT), TorchFlatMap(robot, *between, STEPS, DT)
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


class Renamed(Quadrotor):
    """Moves as its parent does."""

    name = "renamed"

    def hold(self, state: RigidState, dt: float, turn: float = 0.0) -> torch.Tensor:
        return torch.tensor([self.weight, 0.0, 0.0, 0.0])


class Dragged(Quadrotor):
    """Needs more thrust than its parent: the parent's compiled map does not know that."""

    def motion(
        self, free: torch.Tensor, start: RigidState, goal: RigidState, steps: int, dt: float
    ) -> Motion:
        plain = super().motion(free, start, goal, steps, dt)
        drag = torch.tensor([0.1, 0.0, 0.0, 0.0]).to(free)
        return Motion(plain.states, plain.actions + drag, dt)


class Stiffer(Quadrotor):
    """Overrides a method that the parent's motion calls."""

    def _torques(self, rate: torch.Tensor, dt: float) -> torch.Tensor:
        return 2 * super()._torques(rate, dt)


class Bounded(Quadrotor):
    """Has bounds that are not those of its config."""

    def __init__(self) -> None:
        super().__init__()
        self.bounds = tuple(replace(bound, upper=0.1) for bound in self.bounds)


class OwnTwin(Dragged):
    """Brings a compiled map of its own."""

    def compiled_map(self, start: RigidState, goal: RigidState, steps: int, dt: float) -> FlatMap:
        return TorchFlatMap(Quadrotor(), start, goal, steps, dt)


def test_a_subclass_that_moves_as_its_parent_keeps_the_compiled_map():
    for robot in (Renamed(), type("Further", (Renamed,), {})()):
        assert isinstance(robot.flat_map(*ends(robot), STEPS, DT), QuadrotorMap)


@pytest.mark.parametrize("robot", [Dragged(), Stiffer(), Bounded(), type("Further", (Dragged,), {})()])
def test_a_subclass_that_moves_otherwise_is_not_moved_by_its_parents_compiled_map(robot: Quadrotor):
    between = ends(robot)
    flat, free = robot.flat_map(*between, STEPS, DT), free_numbers(robot, between, 0.05)
    assert isinstance(flat, TorchFlatMap)
    flat.forward(free.numpy())
    own = robot.motion(free, *(end.to(torch.float64) for end in between), STEPS, DT)
    assert_near(flat.action, own.actions.numpy(), 1e-12)
    assert flat.limits(1.0) == pytest.approx(robot.limits(own).item())


def test_the_compiled_map_that_a_subclass_brings_is_used():
    robot = OwnTwin()
    flat = robot.flat_map(*ends(robot), STEPS, DT)
    assert isinstance(flat, TorchFlatMap) and type(flat._robot) is Quadrotor


def test_free_fall_and_hover_stay_finite():
    robot = Quadrotor()
    start = goal = RigidState.at_rest((0.0, 0.0, 0.5))
    hover = np.concatenate([[robot.weight] * 2, np.tile([0.0, 0.0, 0.5], STEPS - 4), np.zeros(STEPS - 2)])
    fall = hover.copy()
    heights = 0.5 - 0.5 * robot.config.gravity * (np.arange(4, STEPS) * DT) ** 2
    fall[2 + 2 : 2 + 3 * (STEPS - 4) : 3] = heights
    for free in (hover, fall):
        flat = robot.flat_map(start, goal, STEPS, DT)
        flat.forward(free)
        gradient = flat.backward(np.ones((STEPS + 1, 3)), np.ones((STEPS + 1, 3)), np.ones((STEPS, 4)))
        assert np.isfinite(flat.action).all() and np.isfinite(gradient).all()


def test_a_half_turn_of_the_heading_has_finite_derivatives():
    robot = Quadrotor()
    start, goal = RigidState.at_rest((0.0, 0.0, 0.5), 0.0), RigidState.at_rest((0.5, 0.0, 0.5), float(np.pi))
    flat = robot.flat_map(start, goal, 4, DT)
    flat.forward(np.array([robot.weight, robot.weight, 0.0, np.pi]))
    gradient = flat.backward(np.ones((5, 3)), np.ones((5, 3)), np.ones((4, 4)))
    assert np.isfinite(flat.rate).all() and np.isfinite(gradient).all()
