"""Plans that must not be riskier than asked, and plans that must not take longer than necessary."""


import pytest
import torch

from nerfnav.core.steps import run_steps
from nerfnav.planner.objective.problem import PlanProblem
from nerfnav.planner.risk.costs import collision_probability_bound
from nerfnav.planner.solvers.chance_constraint import enforce_chance_constraint
from nerfnav.planner.solvers.duration import DurationConfig, find_shortest_plan
from nerfnav.planner.solvers.fast import FastPlanConfig, plan_fast
from nerfnav.planner.steps import PlanOutcome, PlanStep, PlanSteps
from nerfnav.robots.robot import limit_uses
from nerfnav.robots.state import RigidState
from tests.planner.places import ROBOT, Fog, Wall, all_of, ball

START, GOAL = RigidState.at_rest((-0.7, 0.02, 0.4)), RigidState.at_rest((0.7, 0.0, 0.4))
AROUND = PlanProblem(ball(), ROBOT, START, GOAL)


def risk(step: PlanStep) -> float:
    return collision_probability_bound(ball(), step.motion, ROBOT.body)


def test_a_plan_is_refined_until_its_bound_is_met():
    careless = FastPlanConfig()
    planned = run_steps(plan_fast(AROUND, careless))
    most = 0.2 * risk(planned)
    assert most > 0
    last = run_steps(enforce_chance_constraint(AROUND, planned, careless, most))
    assert risk(last) <= most
    assert last.outcome is PlanOutcome.CONVERGED
    assert last.cost.control >= planned.cost.control  # safety has its price


def test_a_plan_that_is_safe_enough_stays_as_it_is():
    planned = run_steps(plan_fast(AROUND))
    (last,) = all_of(enforce_chance_constraint(AROUND, planned, FastPlanConfig(), 1.0))
    assert last == planned


def test_in_fog_no_plan_is_safe_enough():
    fog = PlanProblem(Fog(rho=0.5), ROBOT, START, GOAL)
    planned = run_steps(plan_fast(fog))
    last = run_steps(enforce_chance_constraint(fog, planned, FastPlanConfig(), 0.01))
    assert last.outcome is PlanOutcome.TOO_RISKY
    assert collision_probability_bound(fog.field, last.motion, ROBOT.body) > 0.01


def planner(problem: PlanProblem):
    def make(steps: int) -> PlanSteps:
        return plan_fast(PlanProblem(problem.field, ROBOT, START, GOAL, steps, 0.1))

    return make


def test_the_shortest_duration_keeps_the_limits_and_one_step_less_does_not():
    make = planner(PlanProblem(Fog(rho=0.0), ROBOT, START, GOAL))
    last = run_steps(find_shortest_plan(make, ROBOT))
    assert last.outcome is PlanOutcome.CONVERGED
    assert not any(use.violated for use in limit_uses(ROBOT, last.motion))
    shorter = run_steps(make(last.trajectory.steps - 1))
    assert any(use.violated for use in limit_uses(ROBOT, shorter.motion))


def test_where_even_the_longest_plan_exceeds_the_limits_this_is_said():
    make = planner(PlanProblem(Fog(rho=0.0), ROBOT, START, GOAL))
    last = run_steps(find_shortest_plan(make, ROBOT, DurationConfig(fewest=4, most=6)))
    assert last.outcome is PlanOutcome.OVER_LIMITS


def test_a_sealed_goal_is_not_tried_for_longer_and_longer():
    *tried, last = all_of(find_shortest_plan(planner(PlanProblem(Wall(door=0.0), ROBOT, START, GOAL)), ROBOT))
    assert last.outcome is PlanOutcome.NO_PATH and len(tried) == 1
    assert torch.isfinite(last.motion.states.position).all()
    assert pytest.approx(0.1) == last.motion.dt
