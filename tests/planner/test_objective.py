"""The compiled J and its gradient against the reference terms and against finite differences."""

import numpy as np
import pytest
import torch

from nerfnav import robots
from nerfnav.planner import terms
from nerfnav.planner.objective.objective import Objective
from nerfnav.planner.risk.costs import CostWeights
from nerfnav.planner.solvers.bfgs import NewtonConfig, bfgs, minimise, preconditioner
from nerfnav.planner.space.astar import waypoints_along
from nerfnav.planner.terms.term import TermContext, evaluate, select_spaced
from nerfnav.planner.trajectory import Route
from nerfnav.robots.state import RigidState
from tests.planner.places import ROBOT, ball
from tests.robots.motions import SMALL

STEPS, DT = 16, 0.1
START, GOAL = RigidState.at_rest((-0.7, 0.02, 0.4), 0.2), RigidState.at_rest((0.7, 0.0, 0.5), -0.5)
WEIGHTS = CostWeights()
CONTEXT = TermContext(ball(), ROBOT, WEIGHTS)


def guess(spread: float = 0.0) -> np.ndarray:
    """The straight line, right through the ball, more or less disturbed."""
    waypoints = waypoints_along(torch.stack([START.position, GOAL.position]), START, GOAL, STEPS)
    free = ROBOT.encode(waypoints, START, GOAL, DT).double().numpy()
    return free + spread * np.random.default_rng(0).standard_normal(free.shape)


def objective() -> Objective:
    return Objective(CONTEXT, Route(START, GOAL, STEPS, DT), terms.list_terms())


@pytest.mark.parametrize("spread", [0.0, 0.05, 1.0])  # the last one leaves the box and runs out of thrust
def test_the_compiled_terms_and_gradient_are_those_of_the_reference(spread: float):
    free = guess(spread)
    compiled = objective()(free)
    at = torch.from_numpy(free).requires_grad_()
    start, goal = START.to(torch.float64), GOAL.to(torch.float64)
    found = evaluate(terms.list_terms(), CONTEXT, ROBOT.motion(at, start, goal, STEPS, DT))
    reference, (gradient,) = found.numbers(), torch.autograd.grad(found.total, at)
    assert compiled.cost.collision == pytest.approx(reference.collision, rel=1e-5)
    assert compiled.cost.control == pytest.approx(reference.control, rel=1e-5)
    assert compiled.cost.limits == pytest.approx(reference.limits, rel=1e-5, abs=1e-9)
    assert compiled.cost.collision > 0
    np.testing.assert_allclose(compiled.gradient, gradient, rtol=1e-4, atol=1e-5 * gradient.abs().max().item())


def test_the_gradient_is_that_of_finite_differences():
    j, free, step = objective(), guess(0.02), 1e-6
    gradient = j(free).gradient
    for index in range(len(free)):
        offset = step * np.eye(len(free))[index]
        slope = (j(free + offset).cost.total - j(free - offset).cost.total) / (2 * step)
        assert slope == pytest.approx(gradient[index], rel=1e-3, abs=1e-3)


@pytest.mark.parametrize("name", SMALL)
@pytest.mark.parametrize("case", ["on the way", "standing still", "half a turn"])
def test_the_gradient_is_that_of_finite_differences_for_every_robot(name: str, case: str):
    robot, still = robots.load(name), case == "standing still"
    start = RigidState.at_rest((-0.5, 0.03, 0.4), 0.0)
    goal = start if still else RigidState.at_rest((0.5, 0.0, 0.4), 0.3)
    if case == "half a turn":
        goal = RigidState.at_rest((0.5, 0.0, 0.4), np.pi)
    waypoints = waypoints_along(torch.stack([start.position, goal.position]), start, goal, STEPS)
    free = robot.encode(waypoints, start, goal, DT).double().numpy()
    if not still:  # at a standstill distances have a kink, and nothing is met there
        free = free + 0.01 * np.random.default_rng(0).standard_normal(free.shape)
    j, step = Objective(TermContext(ball(), robot, WEIGHTS), Route(start, goal, STEPS, DT), terms.list_terms()), 1e-6
    gradient = j(free).gradient
    assert np.isfinite(gradient).all()
    generator = np.random.default_rng(1)
    for _ in range(12):
        direction = generator.standard_normal(free.shape)
        slope = (j(free + step * direction).cost.total - j(free - step * direction).cost.total) / (2 * step)
        assert slope == pytest.approx(gradient @ direction, rel=2e-3, abs=2e-3)


def test_thrust_near_zero_keeps_the_gradient_finite():
    j, free = objective(), guess()
    free[2 + 2 : 2 + 3 * (STEPS - 4) : 3] = 0.5 - 0.5 * 9.81 * (DT * np.arange(STEPS - 4)) ** 2  # free fall
    reached = j(free)
    assert np.isfinite(reached.gradient).all() and np.isfinite(reached.cost.total)
    assert reached.cost.limits > 0


def test_what_was_looked_at_before_does_not_change_j():
    one, other = guess(), guess(0.1)
    j, alone = objective(), objective()(one)
    j(other)
    again = j(one)
    assert again.cost == alone.cost
    np.testing.assert_array_equal(again.gradient, alone.gradient)


def test_a_coarse_body_keeps_the_outermost_points():
    points = ROBOT.body.points_body
    corners = select_spaced(points, 8)
    assert len(corners.unique(dim=0)) == 8
    assert torch.equal(corners.abs().amax(0), points.abs().amax(0))
    assert len(select_spaced(points, 1000)) == len(points)


def test_bfgs_explains_the_last_change_of_the_gradient():
    generator = np.random.default_rng(0)
    root = generator.standard_normal((5, 5))
    hessian, step = root @ root.T + np.eye(5), generator.standard_normal(5)
    updated = bfgs(np.eye(5), step, step, hessian @ step)
    np.testing.assert_allclose(updated @ hessian @ step, step, atol=1e-10)


def test_bfgs_stays_positive_definite_where_the_curvature_is_negative():
    step = np.array([1.0, 0.5, -0.2])
    updated = bfgs(np.eye(3), step, step, -2 * step)
    assert np.linalg.eigvalsh(updated).min() > 0


def test_the_preconditioner_inverts_a_quadratic_with_its_curvature_made_positive():
    hessian, scales = np.diag([4.0, -2.0, 0.0]), np.array([1.0, 2.0, 0.5])
    inverse = preconditioner(lambda free, steps: hessian, np.zeros(3), scales, 0.01)
    np.testing.assert_allclose(np.diag(inverse), 1 / (np.array([4.0, 2.0, 0.0]) + 0.01 / scales**2), rtol=1e-6)


def test_every_step_of_the_search_lowers_the_cost_until_it_settles():
    scales = ROBOT.free_scales(torch.from_numpy(guess())).numpy()
    steps = list(minimise(objective(), objective()(guess()), scales, NewtonConfig()))
    totals = [step.point.cost.total for step in steps]
    assert totals == sorted(totals, reverse=True)
    assert [step.settled for step in steps].index(True) == len(steps) - 1
    assert totals[-1] < 0.2 * totals[0]
    assert steps[-1].point.cost.collision < 0.1


def test_a_search_begins_again_from_where_it_is_after_each_stretch(monkeypatch: pytest.MonkeyPatch):
    """With the control cost's curvature there; J goes on falling, and what is yielded is one search."""
    made: list[np.ndarray] = []
    scales = ROBOT.free_scales(torch.from_numpy(guess())).numpy()

    def counted(*arguments: object) -> np.ndarray:
        made.append(arguments[1])  # type: ignore[arg-type]
        return preconditioner(*arguments)  # type: ignore[arg-type]

    monkeypatch.setattr("nerfnav.planner.solvers.bfgs.preconditioner", counted)
    steps = list(minimise(objective(), objective()(guess()), scales, NewtonConfig(iterations=25, stretch=10)))
    totals = [step.point.cost.total for step in steps]
    assert len(steps) == 26 and totals == sorted(totals, reverse=True)
    for begun, at in zip(made, (0, 10, 20), strict=True):
        np.testing.assert_array_equal(begun, steps[at].point.free)
