"""Trees in small places, on the meshes of their fields."""

import sys
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import torch

from nerfnav import robots
from nerfnav.core.errors import InvalidInputError, MissingExtraError, OccupiedError
from nerfnav.planner.baselines.rrt import RRTConfig, ball_check, grow, plan_rrt, room_near
from nerfnav.planner.objective.problem import PlanProblem
from nerfnav.planner.space.occupancy import OccupancyConfig, OccupancyMap
from nerfnav.planner.steps import PlanOutcome
from nerfnav.robots.state import RigidState
from tests.planner.places import BOX, ROBOT, Wall, across, ball

COARSE = RRTConfig(mesh_spacing=0.04, time_limit=3.0)
MAP = OccupancyConfig(voxel=0.08)


def test_the_path_keeps_the_ball_clear_of_the_mesh_all_along() -> None:
    problem = across(ball())
    check = ball_check(problem.field, ROBOT, COARSE)
    path = grow(check, BOX, problem.start.position, problem.goal.position, COARSE)
    assert path is not None
    assert torch.equal(path[0], problem.start.position) and torch.equal(path[-1], problem.goal.position)
    for before, after in pairwise(path):
        for share in np.linspace(0, 1, 30):
            assert check.fits((before + share * (after - before)).double().numpy())


def test_the_same_seed_gives_the_same_path_and_another_seed_another() -> None:
    problem = across(ball())
    check = ball_check(problem.field, ROBOT, COARSE)
    one, same, other = (
        grow(check, BOX, problem.start.position, problem.goal.position, replace(COARSE, seed=seed))
        for seed in (3, 3, 4)
    )
    assert one is not None and same is not None and other is not None
    assert torch.equal(one, same)
    assert one.shape != other.shape or not torch.equal(one, other)


def test_a_plan_is_flown_around_the_ball_to_the_goal_under_the_dynamics() -> None:
    problem = across(ball())
    occupancy = OccupancyMap.of(problem.field, ROBOT.body, MAP)
    step = plan_rrt(problem, COARSE, occupancy)
    assert step.outcome is PlanOutcome.CONVERGED
    states = step.motion.states
    assert (states.position[-1] - problem.goal.position).norm() < 0.05
    assert (states.position - torch.tensor([0.0, 0.0, 0.4])).norm(dim=-1).min() > 0.25
    after = ROBOT.step(states[:-1], step.motion.actions, step.motion.dt)
    assert torch.allclose(after.position, states.position[1:], atol=1e-5)
    assert torch.allclose(after.rotation, states.rotation[1:], atol=1e-5)


def test_a_goal_behind_a_closed_wall_ends_at_the_time_limit() -> None:
    problem = across(Wall(door=0.0))
    step = plan_rrt(problem, replace(COARSE, time_limit=0.2))
    assert step.outcome is PlanOutcome.TIME_LIMIT
    assert torch.isfinite(step.motion.states.position).all()


def test_an_end_too_near_to_a_surface_for_the_ball_is_left_the_shortest_way() -> None:
    field = ball()
    check = ball_check(field, ROBOT, replace(COARSE, mesh_spacing=0.02))
    close = torch.tensor([0.0, 0.0, 0.69])  # the ball's surface is at 0.65, and a little higher at this level
    place = room_near(check, BOX, close)
    assert place is not None
    assert 0 < np.linalg.norm(place - close.numpy()) < 0.1
    assert place[2] > 0.7
    roomy = torch.tensor([0.7, 0.7, 0.5])
    assert room_near(check, BOX, roomy) == pytest.approx(roomy.numpy(), abs=1e-6)


def test_a_seed_that_trees_do_not_have_is_refused() -> None:
    problem = across(ball())
    check = ball_check(problem.field, ROBOT, COARSE)
    with pytest.raises(InvalidInputError, match="seed of a tree must be 1 or more, not 0"):
        grow(check, BOX, problem.start.position, problem.goal.position, replace(COARSE, seed=0))


def test_without_ompl_one_sentence_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in sys.modules if name == "ompl" or name.startswith("ompl.")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "ompl", None)  # makes every import of it fail
    problem = across(ball())
    check = ball_check(problem.field, ROBOT, COARSE)
    with pytest.raises(MissingExtraError, match=r"the planner rrt needs ompl, .*: pip install 'nerfnav\[baselines\]'"):
        grow(check, BOX, problem.start.position, problem.goal.position, COARSE)


def test_ends_that_cannot_be_planned_between_are_refused() -> None:
    problem = across(ball())
    inside = RigidState.at_rest((0.0, 0.0, 0.4))
    with pytest.raises(OccupiedError, match="occupied space"):
        plan_rrt(PlanProblem(problem.field, ROBOT, inside, problem.goal), COARSE)


def test_robots_on_the_ground_are_refused() -> None:
    problem = across(ball())
    with pytest.raises(InvalidInputError, match="a couch stays on the ground"):
        plan_rrt(replace(problem, robot=robots.load("couch")), COARSE)
