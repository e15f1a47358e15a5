"""The price of coming later: what it is, and that with it a robot arrives whose arrival is put off at each step."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from nerfnav.core.steps import run_steps
from nerfnav.planner import terms
from nerfnav.planner.objective.objective import Objective
from nerfnav.planner.objective.problem import PlanProblem
from nerfnav.planner.risk.costs import CostWeights
from nerfnav.planner.solvers.fast import FastPlanConfig, plan_fast
from nerfnav.planner.solvers.warm_start import replan_from
from nerfnav.planner.terms.control import CONTROL
from nerfnav.planner.terms.delay import DELAY, delay
from nerfnav.robots.state import RigidState
from tests.planner.objective.test_objective import ROUTE, room
from tests.planner.places import ROBOT, Fog, straight_motion
from tests.planner.test_objective import guess

GOAL = RigidState.at_rest((0.0, 0.0, 0.4))


def test_it_is_the_way_that_is_left_and_less_near_the_goal() -> None:
    context = PlanProblem(Fog(rho=0.0), ROBOT, GOAL, GOAL).context(CostWeights())
    far, near = straight_motion((-2.0, 0.0, 0.4), (0.0, 0.0, 0.4), 2), straight_motion((-0.01, 0, 0.4), (0, 0, 0.4), 1)
    assert delay(context, far).item() == pytest.approx(2 + 1, abs=0.11)
    assert 0 < delay(context, near).item() < 0.002


def test_its_kernel_has_the_value_and_the_derivative_of_the_reference() -> None:
    context = PlanProblem(room(), ROBOT, ROUTE.start, ROUTE.goal, ROUTE.steps, ROUTE.dt).context(CostWeights())
    objective, free = Objective(context, ROUTE, (CONTROL, DELAY)), guess(0.3)
    by_autograd = Objective(context, ROUTE, (CONTROL, replace(DELAY, kernel=None)))
    ours, reference = objective(free), by_autograd(free)
    assert ours.cost.delay == pytest.approx(reference.cost.delay, rel=1e-6) and ours.cost.delay > 0
    np.testing.assert_allclose(ours.gradient, reference.gradient, rtol=1e-4, atol=1e-5 * np.abs(ours.gradient).max())


def test_all_of_j_with_it_is_one_compiled_call_and_equals_the_terms_one_by_one() -> None:
    context = PlanProblem(room(), ROBOT, ROUTE.start, ROUTE.goal, ROUTE.steps, ROUTE.dt).context(CostWeights())
    free = guess(0.3)
    fused = Objective(context, ROUTE, (*terms.list_terms(), DELAY))
    one_by_one = Objective(context, ROUTE, (*terms.list_terms(), replace(DELAY, kernel=None)))
    assert fused.fused is not None and one_by_one.fused is None
    ours, reference, steps = fused(free), one_by_one(free), np.full(len(free), 1e-4)
    for name in ("collision", "control", "limits", "delay"):
        assert getattr(ours.cost, name) == pytest.approx(getattr(reference.cost, name), rel=1e-6), name
    assert ours.cost.delay > 0
    for found, expected in (
        (ours.gradient, reference.gradient),
        (fused.effort_curvature(free, steps), one_by_one.effort_curvature(free, steps)),
    ):
        np.testing.assert_allclose(found, expected, rtol=1e-3, atol=1e-5 * np.abs(expected).max())


def test_a_robot_whose_arrival_is_put_off_at_each_step_comes_near_at_once() -> None:
    start = RigidState.at_rest((0.0, 0.0, 0.22))
    problem = PlanProblem(Fog(rho=0.0), ROBOT, start, GOAL, 6)
    last = run_steps(plan_fast(problem)).motion
    for step in range(4):
        if step:
            assert torch.allclose(last.states.position[-1], GOAL.position, atol=1e-5) and len(last.actions) == 6
        here = replace(problem, start=last.states[1])
        last = run_steps(replan_from(here, last, 1, FastPlanConfig())).motion
    assert (last.states.position[0] - GOAL.position).norm() < 0.03, "9 cm without"
