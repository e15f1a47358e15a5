"""Carrying a plan on in flight, and giving it up in time."""

from dataclasses import replace
from typing import Any

import pytest
import torch
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.core.steps import run_steps
from nerfnav.planner import terms
from nerfnav.planner.objective.problem import PlanProblem
from nerfnav.planner.planners.fast import FastPlanner
from nerfnav.planner.solvers.fast import FastPlanConfig, plan_fast
from nerfnav.planner.solvers.warm_start import WarmStartConfig, _leaves_limits, replan_from
from nerfnav.planner.steps import PlanOutcome, PlanResult, PlanStep, Restart
from nerfnav.planner.terms.term import CostTerm
from nerfnav.planner.trajectory import Route
from nerfnav.robots import limit_uses
from nerfnav.robots.state import Motion, RigidState
from tests.planner.places import ROBOT, Fog, Wall, all_of, ball

START, GOAL = RigidState.at_rest((-0.7, 0.02, 0.4)), RigidState.at_rest((0.7, 0.0, 0.4))


@pytest.fixture(scope="module")
def flown() -> Motion:
    return run_steps(plan_fast(PlanProblem(ball(), ROBOT, START, GOAL))).motion


def again(last: Motion, goal: RigidState = GOAL, field: object = None, **changes: object) -> list[Any]:
    start = last.states[1].retract(torch.tensor([0.01, -0.01, 0.01, *[0.0] * 9]))
    problem = PlanProblem(ball() if field is None else field, ROBOT, start, goal, 19)  # type: ignore[arg-type]
    return all_of(replan_from(problem, last, 1, FastPlanConfig(), **changes))  # type: ignore[arg-type]


def test_a_plan_that_still_leads_to_the_goal_is_continued(flown: Motion):
    steps = again(flown)
    assert all(step.restart is None for step in steps)
    assert steps[-1].outcome is PlanOutcome.CONVERGED
    assert GOAL.local(steps[-1].motion.states[-1]).abs().max() < 1e-5


@pytest.mark.slow
def test_a_plan_is_continued_that_costs_what_its_problem_adds_to_the_cost():
    def high(_: object, motion: Motion) -> Tensor:
        return (motion.states.position[..., 2] - 0.8).square().sum(-1)

    first = PlanProblem(ball(), ROBOT, START, GOAL, terms=(*terms.list_terms(), CostTerm("high", high, 1000.0)))
    flown = run_steps(plan_fast(first))
    assert flown.cost.added[0].value > 0.5 * flown.cost.total
    left = replace(first, start=flown.motion.states[1].retract(torch.tensor([0.01, -0.01, *[0.0] * 10])), steps=19)
    assert run_steps(replan_from(left, flown.motion, 1, FastPlanConfig())).restart is None


def test_a_goal_that_moved_is_followed(flown: Motion):
    goal = RigidState.at_rest((0.0, 0.8, 0.4))
    last = again(flown, goal)[-1]
    assert last.restart is Restart.GOAL_MOVED
    assert last.outcome is PlanOutcome.CONVERGED
    assert goal.local(last.motion.states[-1]).abs().max() < 1e-5


def test_where_a_goal_has_turned_a_plan_never_costs_more_than_what_was_left_of_it_and_turns_evenly(flown: Motion):
    turned = RigidState.at_rest((0.7, 0.0, 0.4), 0.5)
    steps, straight = again(flown, turned), again(flown)[-1]
    assert steps[-1].restart is Restart.GOAL_MOVED and steps[-1].outcome is PlanOutcome.CONVERGED
    assert turned.local(steps[-1].motion.states[-1]).abs().max() < 1e-5
    assert steps[-1].cost.total < straight.cost.total + 0.2
    assert steps[-1].cost.total <= min(step.cost.total for step in steps) + 1e-6


def test_a_plan_that_has_become_dear_is_made_anew_and_the_better_one_is_kept(flown: Motion):
    steps = again(flown, warm=WarmStartConfig(rise=0.5, slack=0.0))
    assert steps[-1].restart is Restart.COST_ROSE
    assert [type(step) for step in steps] == [PlanStep] * (len(steps) - 1) + [PlanResult]
    assert [step.iteration for step in steps] == list(range(len(steps)))
    assert steps[-1].cost.total <= min(again(flown)[-1].cost.total, *(step.cost.total for step in steps)) + 1e-6


def test_a_plan_through_what_turns_out_to_be_a_wall_is_made_anew():
    flown = run_steps(plan_fast(PlanProblem(Fog(rho=0.0), ROBOT, START, GOAL))).motion  # straight on
    last = again(flown, field=Wall(door=0.5))[-1]
    assert last.restart in (Restart.IN_COLLISION, Restart.COST_ROSE)
    assert last.outcome is PlanOutcome.CONVERGED
    crossing = last.motion.states.position[last.motion.states.position[:, 0].abs().argmin()]
    assert abs(crossing[1] - 0.5) < 0.25  # through the door


def test_behind_a_sealed_wall_there_is_no_path(flown: Motion):
    last = again(flown, field=Wall(door=0.0))[-1]
    assert last.restart is not None
    assert last.outcome in (PlanOutcome.IN_COLLISION, PlanOutcome.NO_PATH)


def test_a_plan_that_is_no_number_is_made_anew(flown: Motion):
    broken = flown.map(torch.clone)
    broken.actions[5] = float("nan")
    last = again(broken)[-1]
    assert last.restart is Restart.UNUSABLE
    assert last.outcome is PlanOutcome.CONVERGED


@pytest.mark.parametrize("executed", [12, 13])
def test_a_plan_that_cannot_be_followed_within_the_limits_is_made_anew(flown: Motion, executed: int):
    left = len(flown.actions) - executed  # the robot is still at its start: 1.4 m in 0.7 s
    last = run_steps(replan_from(PlanProblem(ball(), ROBOT, START, GOAL, left), flown, executed, FastPlanConfig()))
    assert last.restart is Restart.UNUSABLE and last.outcome is PlanOutcome.CONVERGED
    assert len(last.motion.actions) > left and not any(use.violated for use in limit_uses(ROBOT, last.motion))


def test_a_start_beyond_the_limits_is_no_fault_of_the_plan(flown: Motion):
    speeds = torch.full((len(flown.actions) + 1, 1), 1.1 * ROBOT.config.max_speed)
    fast = replace(flown, states=replace(flown.states, velocity=speeds * torch.tensor([1.0, 0.0, 0.0])))
    assert not _leaves_limits(ROBOT, fast)
    fast.states.velocity[5] *= 1.1
    assert _leaves_limits(ROBOT, fast)


def test_a_start_that_is_no_number_is_refused(flown: Motion):
    start = RigidState.at_rest((float("nan"), 0.0, 0.4))
    with pytest.raises(InvalidInputError, match="position of the start must be finite"):
        all_of(replan_from(PlanProblem(ball(), ROBOT, start, GOAL, 19), flown, 1, FastPlanConfig()))


def test_the_planner_of_the_loop_says_why_it_planned_anew(flown: Motion):
    planner = FastPlanner(ball(), ROBOT)
    moved = RigidState.at_rest((0.0, -0.8, 0.4))
    assert run_steps(planner.replan(flown, Route(flown.states[1], moved, 19), 1)).restart is Restart.GOAL_MOVED
    assert run_steps(planner.replan(flown, Route(flown.states[1], GOAL, 19), 1)).restart is None


def test_a_plan_that_is_made_anew_may_take_the_time_that_its_way_takes(flown: Motion):
    far = RigidState.at_rest((0.75, 0.8, 0.4))
    start = RigidState.at_rest((-0.8, -0.8, 0.4))
    problem = PlanProblem(ball(), ROBOT, start, far, 6)
    last = run_steps(replan_from(problem, flown, 14, FastPlanConfig()))
    assert last.restart is Restart.GOAL_MOVED and last.outcome is PlanOutcome.CONVERGED
    assert len(last.motion.actions) > 10
