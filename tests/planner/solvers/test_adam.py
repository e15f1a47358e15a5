"""The paper's planner, from the first guess to the outcome."""

from dataclasses import dataclass, replace
from typing import Any

import pytest
import torch
from torch import Tensor

from nerfnav.core.errors import InvalidInputError, OccupiedError
from nerfnav.planner.objective.problem import InitialGuess
from nerfnav.planner.risk.costs import CostWeights
from nerfnav.planner.solvers.adam import PlanConfig, plan, replan
from nerfnav.planner.solvers.warm_start import shift_warm_start
from nerfnav.planner.space.occupancy import OccupancyConfig, OccupancyMap
from nerfnav.planner.steps import FLYABLE, PlanOutcome, PlanResult, PlanStep
from nerfnav.robots.state import RigidState
from tests.planner.places import ROBOT, Colorless, Fog, Wall, across, all_of, ball

QUICK = PlanConfig(iterations=120, learning_rate=3e-3, occupancy=OccupancyConfig(voxel=0.05))


@pytest.fixture(scope="module")
def around_the_ball() -> list[Any]:
    return all_of(plan(across(ball()), QUICK))


def test_the_plan_leads_around_the_ball(around_the_ball: list[Any]):
    last = around_the_ball[-1]
    distance = (last.motion.states.position - torch.tensor([0.0, 0.0, 0.4])).norm(dim=-1)
    assert distance.min() > 0.28
    assert last.cost.collision < 0.1
    assert last.cost.limits < 1e-4  # a bound is passed by so little that nothing is


def test_every_iteration_is_yielded_and_the_result_counts_as_the_last(around_the_ball: list[Any]):
    assert [step.iteration for step in around_the_ball] == list(range(120))
    assert [type(step) for step in around_the_ball] == [PlanStep] * 119 + [PlanResult]
    assert around_the_ball[-1].outcome in FLYABLE


def test_the_result_is_the_best_trajectory_of_all(around_the_ball: list[Any]):
    assert around_the_ball[-1].cost.total == min(step.cost.total for step in around_the_ball)
    assert around_the_ball[-1].cost.total < 0.95 * around_the_ball[0].cost.total


def test_each_step_says_what_its_own_trajectory_costs(around_the_ball: list[Any]):
    problem = across(ball())
    for step in around_the_ball[::40]:
        motion = step.trajectory.motion(ROBOT)
        terms = problem.cost(motion, QUICK.weights).numbers()
        assert terms.total == pytest.approx(step.cost.total, rel=1e-4)
        torch.testing.assert_close(motion.states.position, step.motion.states.position)


def test_what_is_yielded_carries_no_autograd_history(around_the_ball: list[Any]):
    for step in around_the_ball:
        assert not step.trajectory.free.requires_grad
        assert not step.motion.actions.requires_grad and not step.motion.states.position.requires_grad


def test_rolling_the_final_plan_reproduces_it_and_ends_at_the_goal(around_the_ball: list[Any]):
    motion = around_the_ball[-1].motion
    state = across(ball()).start
    for time, action in enumerate(motion.actions):
        state = ROBOT.step(state, action, motion.dt)
        assert motion.states[time + 1].local(state).abs().max() < 1e-4
    assert across(ball()).goal.local(state).abs().max() < 1e-4


@pytest.mark.slow
def test_in_free_space_the_cost_settles_below_that_of_the_first_guess():
    steps = all_of(plan(across(Fog(rho=0.0)), replace(QUICK, iterations=400)))
    assert steps[-1].outcome is PlanOutcome.CONVERGED
    # holding the weight for 20 steps costs 20 before weighting, whatever the way
    least = 20 * QUICK.weights.control
    assert 0.98 * least < steps[-1].cost.total < min(1.2 * least, steps[0].cost.total)


def test_a_cost_that_still_falls_is_said_to():
    steps = all_of(plan(across(ball()), replace(QUICK, iterations=30)))
    assert steps[-1].outcome is PlanOutcome.ITERATION_LIMIT


def test_a_wall_without_a_door_has_no_path():
    steps = all_of(plan(across(Wall(door=0.0)), QUICK))
    assert [step.outcome for step in steps] == [PlanOutcome.NO_PATH]
    assert steps[0].cost.collision > 10


def test_a_straight_first_guess_goes_through_everything():
    straight = next(plan(across(ball()), replace(QUICK, initial=InitialGuess.STRAIGHT)))
    around = next(plan(across(ball()), QUICK))
    assert straight.cost.collision > 100 > around.cost.collision


def test_a_map_made_once_gives_the_same_plan():
    occupancy = OccupancyMap.of(ball(), ROBOT.body, QUICK.occupancy)
    config = replace(QUICK, iterations=3)
    one, other = all_of(plan(across(ball()), config)), all_of(plan(across(ball()), config, occupancy))
    assert torch.equal(one[-1].trajectory.free, other[-1].trajectory.free)


@dataclass(frozen=True)
class Broken(Colorless):
    """A field whose density is no number near the middle."""

    def density(self, points: Tensor) -> Tensor:
        return torch.where(points[..., 0].abs() < 0.1, torch.nan, 0.0).to(points)


def test_a_cost_that_is_no_number_ends_the_plan_as_diverged():
    steps = all_of(plan(across(Broken()), replace(QUICK, initial=InitialGuess.STRAIGHT)))
    assert steps[-1].outcome is PlanOutcome.DIVERGED


def test_bad_ends_are_refused_before_any_iteration():
    problem = across(ball())
    with pytest.raises(OccupiedError):
        next(plan(replace(problem, goal=RigidState.at_rest((0, 0, 0.4))), QUICK))
    with pytest.raises(InvalidInputError):
        next(plan(replace(problem, start=RigidState.at_rest((0, float("nan"), 0.4))), QUICK))


def test_replanning_goes_on_from_the_rest_of_the_plan(around_the_ball: list[Any]):
    problem, motion = across(ball()), around_the_ball[-1].motion
    start = motion.states[1].retract(0.02 * torch.randn(12, generator=torch.Generator().manual_seed(0)))
    hot = shift_warm_start(motion, start, problem.goal, ROBOT)
    steps = all_of(replan(problem, hot, replace(QUICK, iterations=60)))
    assert len(steps) == 60
    assert steps[-1].motion.actions.shape == (19, 4)
    torch.testing.assert_close(steps[-1].motion.states.position[0], start.position)
    assert steps[-1].cost.total <= steps[0].cost.total
    assert steps[-1].cost.collision < 1


def test_replanning_works_from_inside_a_stone():
    problem = replace(across(ball()), start=RigidState.at_rest((-0.2, 0.05, 0.4)))
    motion = next(plan(across(ball()), QUICK)).motion
    steps = list(
        replan(problem, shift_warm_start(motion, problem.start, problem.goal, ROBOT), replace(QUICK, iterations=20))
    )
    assert steps[-1].cost.total < steps[0].cost.total


def test_planning_between_moving_ends_meets_both():
    fast = RigidState.at_rest((-0.7, 0.4, 0.4)).retract(torch.tensor([0.0] * 3 + [0.5, 0, 0] + [0, 0.1, 0] + [0.0] * 3))
    problem = replace(across(ball()), start=fast)
    motion = all_of(plan(problem, replace(QUICK, iterations=30)))[-1].motion
    torch.testing.assert_close(motion.states.velocity[0], fast.velocity)
    torch.testing.assert_close(motion.states.rotation[0], fast.rotation)


def test_the_paper_presets_have_the_papers_numbers():
    assert PlanConfig.paper().iterations == 2500
    assert PlanConfig.paper_replan().iterations == 250
    assert (across(ball()).steps, across(ball()).dt) == (20, 0.1)
    assert CostWeights().collision == 1
