"""Plans that are carried along with ends that move."""

from dataclasses import replace

import pytest
import torch

from nerfnav.core.errors import OccupiedError
from nerfnav.core.steps import run_steps
from nerfnav.planner.objective.problem import PlanProblem
from nerfnav.planner.planners import PLANNERS
from nerfnav.planner.planners.planner import InteractivePlanner
from nerfnav.planner.solvers.fast import plan_fast
from nerfnav.planner.solvers.warm_start import move_ends, replan_moved_ends
from nerfnav.planner.steps import FLYABLE
from nerfnav.robots.state import Motion, RigidState
from tests.planner.places import ROBOT, all_of, ball

PROBLEM = PlanProblem(ball(), ROBOT, RigidState.at_rest((-0.7, 0.02, 0.4)), RigidState.at_rest((0.7, 0.0, 0.4)))


@pytest.fixture(scope="module")
def last() -> Motion:
    return run_steps(plan_fast(PROBLEM)).motion


def test_waypoints_move_by_their_share_and_the_yaw_turns_the_short_way(last: Motion) -> None:
    moved = replace(
        PROBLEM, start=RigidState.at_rest((-0.6, 0.1, 0.5), 3.0), goal=RigidState.at_rest((0.5, 0.3, 0.4), -3.0)
    )
    carried = move_ends(last, moved).motion(ROBOT)
    for state, end in ((carried.states[0], moved.start), (carried.states[-1], moved.goal)):
        assert end.local(state).abs().max() < 1e-4
    same = move_ends(last, PROBLEM).motion(ROBOT)
    torch.testing.assert_close(same.states.position, last.states.position, atol=1e-3, rtol=0)


def test_a_plan_that_follows_small_moves_stays_as_good_as_one_from_scratch(last: Motion) -> None:
    goals = [RigidState.at_rest((0.7 - 0.03 * step, 0.04 * step, 0.4)) for step in range(1, 7)]
    costs = []
    for goal in goals:
        found = run_steps(replan_moved_ends(replace(PROBLEM, goal=goal), last))
        assert found.outcome in FLYABLE and goal.local(found.motion.states[-1]).abs().max() < 1e-4
        last = found.motion
        costs.append(found.cost.total)
    assert costs[-1] < 1.05 * run_steps(plan_fast(replace(PROBLEM, goal=goals[-1]))).cost.total


def test_a_plan_that_would_be_moved_through_something_is_made_anew(last: Motion) -> None:
    through = replace(PROBLEM, goal=RigidState.at_rest((-0.7, -0.5, 0.4)))
    states = replace(last.states, position=torch.linspace(-0.7, 0.7, 21)[:, None] * torch.tensor([1.0, 0.0, 0.0]))
    states = replace(states, position=states.position + torch.tensor([0.0, 0.0, 0.4]))
    steps = all_of(replan_moved_ends(PROBLEM, replace(last, states=states)))
    assert steps[-1].outcome in FLYABLE
    assert [step.iteration for step in steps] == list(range(len(steps)))
    assert run_steps(replan_moved_ends(through, last)).outcome in FLYABLE


def test_ends_in_something_are_refused(last: Motion) -> None:
    with pytest.raises(OccupiedError, match="the goal"):
        run_steps(replan_moved_ends(replace(PROBLEM, goal=RigidState.at_rest((0.0, 0.0, 0.4))), last))


def test_every_planner_that_is_real_time_follows_ends() -> None:
    for entry in PLANNERS.values():
        if entry.real_time:
            assert isinstance(entry.planner(PROBLEM.field, ROBOT), InteractivePlanner)
