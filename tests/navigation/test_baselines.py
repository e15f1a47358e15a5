"""The paper's baselines in the shape that the loop asks for."""

from collections.abc import Callable
from functools import partial

import pytest
import torch

from nerfnav.navigation.baselines import MinSnapPlanner, RRTPlanner
from nerfnav.navigation.planners import Planner
from nerfnav.planner.rrt import RRTConfig
from nerfnav.planner.steps import PlanOutcome
from nerfnav.robots.state import RigidState
from tests.planner.places import ROBOT, across, ball

COARSE = RRTConfig(mesh_spacing=0.04)
MAKERS = [MinSnapPlanner, partial(RRTPlanner, first=COARSE, again=COARSE)]


@pytest.mark.parametrize("make", MAKERS, ids=["minsnap", "rrt"])
def test_what_is_left_of_a_plan_is_planned_again_from_where_the_robot_is(make: Callable[..., Planner]) -> None:
    problem = across(ball())
    planner = make(problem.field, ROBOT)
    assert isinstance(planner, Planner)
    *_, first = planner.plan(problem.start, problem.goal, 20, 0.1)
    assert first.outcome is PlanOutcome.CONVERGED
    executed = 6
    pushed = first.motion.states[executed].retract(torch.tensor([0.02, -0.02, 0.01, *[0.0] * 9]))
    *_, again = planner.replan(first.motion, pushed, problem.goal, 14, executed)
    states = again.motion.states
    assert torch.allclose(states.position[0], pushed.position)
    assert torch.allclose(states.position[-1], problem.goal.position, atol=1e-4)
    assert len(again.motion.actions) == 14
    apart = (states.position - first.motion.states.position[executed:]).norm(dim=-1)
    assert apart.max() < 0.2, "it follows the rest of the plan"


@pytest.mark.parametrize("make", MAKERS, ids=["minsnap", "rrt"])
def test_a_longer_horizon_than_what_is_left_waits_at_the_goal(make: Callable[..., Planner]) -> None:
    problem = across(ball())
    planner = make(problem.field, ROBOT)
    *_, first = planner.plan(problem.start, problem.goal, 20, 0.1)
    near = RigidState.at_rest((0.68, 0.0, 0.4), 0.5)
    *_, again = planner.replan(first.motion, near, problem.goal, 6, 18)
    assert len(again.motion.actions) == 6
    assert torch.isfinite(again.motion.actions).all()
    assert (again.motion.states.position - problem.goal.position).norm(dim=-1).max() < 0.3
