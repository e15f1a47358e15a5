"""The paper's baselines in the shape that the loop asks for."""

from collections.abc import Callable
from functools import partial

import pytest
import torch

from nerfnav import robots
from nerfnav.core.steps import run_steps
from nerfnav.planner import terms
from nerfnav.planner.baselines.rrt import RRTConfig
from nerfnav.planner.planners.minsnap import MinSnapPlanner
from nerfnav.planner.planners.planner import Planner
from nerfnav.planner.planners.rrt import RRTPlanner
from nerfnav.planner.steps import PlanOutcome
from nerfnav.planner.terms.term import CostTerm
from nerfnav.planner.trajectory import Route
from nerfnav.robots.state import RigidState
from tests.planner.places import ROBOT, across, ball

COARSE = RRTConfig(mesh_spacing=0.04)
LAST_X = CostTerm("last x", lambda _, motion: motion.states.position[..., -1, 0])
MAKERS = [MinSnapPlanner, partial(RRTPlanner, first=COARSE, again=COARSE)]


@pytest.mark.parametrize("make", MAKERS, ids=["minsnap", "rrt"])
def test_what_is_left_of_a_plan_is_planned_again_from_where_the_robot_is(make: Callable[..., Planner]) -> None:
    problem = across(ball(0.15), height=0.5)  # with room below and above
    planner = make(problem.field, ROBOT)
    assert isinstance(planner, Planner)
    first = run_steps(planner.plan(problem.route))
    assert first.outcome is PlanOutcome.CONVERGED
    executed = 6
    pushed = first.motion.states[executed].retract(torch.tensor([0.02, -0.02, 0.01, *[0.0] * 9]))
    again = run_steps(planner.replan(first.motion, Route(pushed, problem.goal, 14), executed))
    states = again.motion.states
    assert torch.allclose(states.position[0], pushed.position)
    assert torch.allclose(states.position[-1], problem.goal.position, atol=1e-4)
    assert len(again.motion.actions) == 14
    apart = (states.position - first.motion.states.position[executed:]).norm(dim=-1)
    assert apart.max() < 0.2, "it follows the rest of the plan"


def test_what_is_added_to_the_cost_is_counted_whoever_plans() -> None:
    problem = across(ball())
    planner = MinSnapPlanner(problem.field, ROBOT, terms=(*terms.list_terms(), LAST_X))
    first = run_steps(planner.plan(problem.route))
    again = run_steps(planner.replan(first.motion, Route(first.motion.states[6], problem.goal, 14), 6))
    for step in (first, again):
        (added,) = step.cost.added
        assert added.value == pytest.approx(problem.goal.position[0].item(), abs=1e-4)


def test_a_cart_that_is_believed_to_be_in_the_air_is_planned_for_on_the_ground() -> None:
    start, goal = RigidState.at_rest((-0.7, 0.05, 0.1)), RigidState.at_rest((0.7, 0.0, 0.1))
    planner = MinSnapPlanner(across(ball()).field, robots.load("diffdrive"))
    first = run_steps(planner.plan(Route(start, goal)))
    lifted = first.motion.states[6].retract(torch.tensor([0.0, 0.0, 0.02, *[0.0] * 3, 0.02, *[0.0] * 5]))
    again = run_steps(planner.replan(first.motion, Route(lifted, goal, 14), 6))
    torch.testing.assert_close(again.motion.states.position[:, 2], torch.full((15,), 0.1))


@pytest.mark.parametrize("make", MAKERS, ids=["minsnap", "rrt"])
def test_a_longer_horizon_than_what_is_left_waits_at_the_goal(make: Callable[..., Planner]) -> None:
    problem = across(ball())
    planner = make(problem.field, ROBOT)
    first = run_steps(planner.plan(problem.route))
    near = RigidState.at_rest((0.68, 0.0, 0.4), 0.5)
    again = run_steps(planner.replan(first.motion, Route(near, problem.goal, 6), 18))
    assert len(again.motion.actions) == 6
    assert torch.isfinite(again.motion.actions).all()
    assert (again.motion.states.position - problem.goal.position).norm(dim=-1).max() < 0.3
