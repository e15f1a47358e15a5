"""The fast planner: as exact as the paper's, no more costly, and much sooner done."""

import math
import time
from collections.abc import Callable
from dataclasses import replace

import pytest
import torch
from torch import Tensor

from nerfnav import robots
from nerfnav.core.errors import OccupiedError
from nerfnav.core.steps import run_steps
from nerfnav.geometry import so3
from nerfnav.planner import terms
from nerfnav.planner.objective.problem import InitialGuess, PlanProblem
from nerfnav.planner.objective.safety import SafetyConfig, measure_clearance
from nerfnav.planner.solvers.adam import PlanConfig, plan
from nerfnav.planner.solvers.bfgs import NewtonConfig
from nerfnav.planner.solvers.fast import FastPlanConfig, plan_fast, replan_fast
from nerfnav.planner.solvers.warm_start import shift_warm_start
from nerfnav.planner.steps import PlanOutcome, PlanSteps
from nerfnav.planner.terms.term import CostTerm
from nerfnav.robots.quadrotor import Quadrotor, QuadrotorConfig
from nerfnav.robots.state import Motion, RigidState
from tests.planner.places import ROBOT, Fog, Wall, all_of, ball

START, GOAL = RigidState.at_rest((-0.7, 0.02, 0.4), 0.2), RigidState.at_rest((0.7, 0.0, 0.5), -0.5)


def around_the_ball() -> PlanProblem:
    return PlanProblem(ball(), ROBOT, START, GOAL)


def test_a_plan_around_a_ball_converges_without_touching_it():
    last = run_steps(plan_fast(around_the_ball()))
    assert last.outcome is PlanOutcome.CONVERGED
    distance = (last.motion.states.position - torch.tensor([0.0, 0.0, 0.4])).norm(dim=-1)
    assert distance.min() > 0.25 + 0.02  # the radius and half the body's height
    assert last.cost.collision < 0.1


def test_the_ends_are_met_and_the_actions_fly_the_plan():
    last = run_steps(plan_fast(around_the_ball()))
    states, state = last.motion.states, START
    for t, action in enumerate(last.motion.actions):
        state = ROBOT.step(state, action, last.motion.dt)
        assert states[t + 1].local(state).abs().max() < 1e-3  # rates differ most; single precision
        assert (states[t + 1].position - state.position).abs().max() < 1e-4
    assert GOAL.local(states[-1]).abs().max() < 1e-5
    assert START.local(states[0]).abs().max() < 1e-5


@pytest.mark.slow
def test_its_cost_is_no_higher_than_that_of_adam():
    adam = run_steps(plan(around_the_ball(), PlanConfig(iterations=1000)))
    fast = run_steps(plan_fast(around_the_ball()))
    assert fast.cost.total <= 1.02 * adam.cost.total
    reference = around_the_ball().cost(fast.motion, FastPlanConfig().weights).numbers()
    assert reference.total == pytest.approx(fast.cost.total, rel=1e-2)  # the same J


def test_every_iteration_from_one_start_costs_less_than_the_one_before_and_the_last_of_all_the_least():
    steps = all_of(plan_fast(around_the_ball()))
    starts = {step.start_index for step in steps}
    assert len(starts) > 1
    for start in starts:
        totals = [step.cost.total for step in steps if step.start_index == start]
        assert totals == sorted(totals, reverse=True)
        assert totals[-1] < totals[0]
    assert steps[-1].cost.total == min(step.cost.total for step in steps)
    assert [step.iteration for step in steps] == list(range(len(steps)))


def test_a_sealed_goal_has_no_path():
    sealed = PlanProblem(Wall(door=0.0), ROBOT, START, RigidState.at_rest((0.7, 0.5, 0.5)))
    assert run_steps(plan_fast(sealed)).outcome is PlanOutcome.NO_PATH


def test_a_goal_inside_the_ball_is_refused_with_the_nearest_free_point():
    inside = PlanProblem(ball(), ROBOT, START, RigidState.at_rest((0.0, 0.0, 0.4)))
    with pytest.raises(OccupiedError, match=r"the goal .* is in occupied space; the nearest free point is"):
        next(plan_fast(inside))


def test_too_few_iterations_are_reported():
    config = FastPlanConfig(newton=NewtonConfig(iterations=3))
    assert run_steps(plan_fast(around_the_ball(), config)).outcome is PlanOutcome.ITERATION_LIMIT


def test_start_and_goal_may_be_the_same_place():
    still = PlanProblem(ball(), ROBOT, START, START)
    last = run_steps(plan_fast(still, FastPlanConfig(initial=InitialGuess.STRAIGHT)))
    assert last.outcome is PlanOutcome.CONVERGED
    assert (last.motion.states.position - START.position).norm(dim=-1).max() < 0.05


def test_replanning_after_a_kick_starts_near_and_ends_at_the_goal():
    first = run_steps(plan_fast(around_the_ball()))
    kicked = first.motion.states[1].retract(torch.tensor([0.02, -0.02, 0.01, *[0.0] * 3, 0.02, 0.02, 0.0, *[0.0] * 3]))
    trajectory = shift_warm_start(first.motion, kicked, GOAL, ROBOT)
    last = run_steps(replan_fast(around_the_ball(), trajectory))
    assert last.outcome is PlanOutcome.CONVERGED
    assert GOAL.local(last.motion.states[-1]).abs().max() < 1e-5
    assert last.cost.total < 2 * first.cost.total + 1


def impossible(name: str) -> tuple[PlanProblem, PlanOutcome]:
    low = RigidState.at_rest((0.7, 0.0, 0.4))
    big = Quadrotor(QuadrotorConfig(extents=(0.3, 0.3, 0.3)))
    start = RigidState.at_rest((-0.7, 0.02, 0.4))
    return {
        "sealed in": (PlanProblem(Wall(door=0.0), ROBOT, start, low), PlanOutcome.NO_PATH),
        "too large": (PlanProblem(Wall(door=0.3), big, start, low), PlanOutcome.NO_PATH),
        "too short": (PlanProblem(Fog(rho=0.0), ROBOT, start, low, steps=5), PlanOutcome.OVER_LIMITS),
        "no distance": (PlanProblem(ball(), ROBOT, start, start), PlanOutcome.CONVERGED),
    }[name]


@pytest.mark.parametrize("name", ["sealed in", "too large", "too short", "no distance"])
def test_impossible_tasks_end_soon_in_an_outcome_that_has_a_name(name: str):
    problem, expected = impossible(name)
    begun = time.process_time()
    last = run_steps(plan_fast(problem))
    assert time.process_time() - begun < 2.0
    assert last.outcome is expected
    assert torch.isfinite(last.motion.states.position).all() and torch.isfinite(last.motion.actions).all()


def test_a_straight_plan_through_a_sealed_wall_is_in_collision():
    problem = PlanProblem(Wall(door=0.0), ROBOT, START, RigidState.at_rest((0.7, 0.0, 0.4)))
    config = FastPlanConfig(initial=InitialGuess.STRAIGHT, newton=NewtonConfig(iterations=20))
    assert run_steps(plan_fast(problem, config)).outcome is PlanOutcome.IN_COLLISION


def below_80_cm(_: object, motion: Motion) -> Tensor:
    """Squared distances from a height of 80 cm [m^2]."""
    return (motion.states.position[..., 2] - 0.8).square().sum(-1)


@pytest.mark.parametrize(
    "make",
    [
        pytest.param(plan_fast, id="fast"),
        pytest.param(lambda problem: plan(problem, PlanConfig(iterations=300)), id="paper", marks=pytest.mark.slow),
    ],
)
def test_any_differentiable_term_can_be_added(make: Callable[[PlanProblem], PlanSteps]):
    high = CostTerm("high", below_80_cm, 5.0)
    empty = PlanProblem(Fog(rho=0.0), ROBOT, START, GOAL)
    plain, lifted = (run_steps(make(one)) for one in (empty, replace(empty, terms=(*terms.list_terms(), high))))
    assert lifted.motion.states.position[10, 2] > plain.motion.states.position[10, 2] + 0.1
    (added,) = lifted.cost.added
    assert (added.name, added.value) == ("high", pytest.approx(5 * below_80_cm(None, lifted.motion).item(), rel=1e-3))
    assert added.ms > 0
    assert lifted.cost.total == pytest.approx(
        lifted.cost.collision + lifted.cost.control + lifted.cost.limits + added.value
    )


def test_a_long_body_turns_where_it_fits_only_turned():
    couch, across = robots.load("couch"), math.pi / 2
    start, goal = RigidState.at_rest((-0.7, 0.4, 0.4), across), RigidState.at_rest((0.7, 0.4, 0.4), across)
    wall = Wall(door=0.28, thickness=0.05)
    last = run_steps(plan_fast(PlanProblem(wall, couch, start, goal, 30)))
    assert last.outcome is PlanOutcome.CONVERGED
    inside = last.motion.states[last.motion.states.position[:, 0].abs() < 0.1]
    assert len(inside.position)
    assert torch.sin(so3.yaw_of(inside.rotation)).abs().max() < 0.3  # along the way through the door
    assert measure_clearance(wall, last.motion, couch.body, SafetyConfig()) > 0.01
