"""Whatever is asked, every robot gets a named outcome or a reason, soon."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import pytest
import torch

from nerfnav.core.errors import InvalidInputError, OccupiedError
from nerfnav.core.steps import run_steps
from nerfnav.field.core.protocol import Field
from nerfnav.planner.baselines.minsnap import plan_minimum_snap
from nerfnav.planner.baselines.rrt import plan_rrt
from nerfnav.planner.objective.problem import PlanProblem
from nerfnav.planner.solvers.fast import plan_fast
from nerfnav.planner.steps import PlanOutcome, PlanResult
from nerfnav.robots.robot import Robot
from nerfnav.robots.state import RigidState
from tests.planner.places import Wall, ball
from tests.robots.motions import SMALL

LEFT, RIGHT = RigidState.at_rest((-0.7, 0.02, 0.4)), RigidState.at_rest((0.7, 0.0, 0.4), 0.5)
SOON = 2.0
"""Longest time to an answer on an idle machine [s], kernels compiled."""

each_robot = pytest.mark.parametrize("robot", SMALL.values(), ids=SMALL)


@dataclass(frozen=True)
class Case:
    """Something hard or pointless to ask for."""

    field: Field
    goal: RigidState
    outcomes: tuple[PlanOutcome, ...]
    steps: int | None = 20


TOO_SHORT = (PlanOutcome.OVER_LIMITS, PlanOutcome.IN_COLLISION)
CASES = {
    "a goal that is sealed in": Case(Wall(door=0.0), RIGHT, (PlanOutcome.NO_PATH,)),
    "a gap smaller than the body": Case(Wall(door=0.06), RIGHT, (PlanOutcome.NO_PATH,)),
    "a duration that is too short": Case(ball(), RIGHT, TOO_SHORT, 6),
    "the fewest steps there are": Case(ball(), RIGHT, TOO_SHORT, None),
    "no distance": Case(ball(), LEFT, (PlanOutcome.CONVERGED,)),
    "no distance in the fewest steps": Case(ball(), LEFT, (PlanOutcome.CONVERGED,), None),
    "a tenth of a millimetre": Case(ball(), RigidState.at_rest((-0.7, 0.0201, 0.4)), (PlanOutcome.CONVERGED,)),
    "a small step aside": Case(ball(), RigidState.at_rest((-0.7, 0.12, 0.4)), (PlanOutcome.CONVERGED,)),
    "half a turn on the spot": Case(ball(), RigidState.at_rest((-0.7, 0.02, 0.4), torch.pi), (PlanOutcome.CONVERGED,)),
}


def planned(robot: Robot, case: Case) -> PlanResult:
    return run_steps(plan_fast(PlanProblem(case.field, robot, LEFT, case.goal, case.steps or robot.minimum_steps)))


@each_robot
@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_it_ends_in_a_named_outcome_with_a_finite_plan_that_meets_the_goal(robot: Robot, case: Case):
    last = planned(robot, case)
    assert last.outcome in case.outcomes
    states = last.motion.states
    for part in (states.position, states.velocity, states.rotation, states.body_rate, last.motion.actions):
        assert torch.isfinite(part).all()
    assert (states.position[-1] - case.goal.position).norm() < 1e-4


@each_robot
def test_it_ends_soon(robot: Robot):
    case = CASES["a duration that is too short"]
    planned(robot, case)
    began = time.process_time()
    planned(robot, case)
    assert time.process_time() - began < SOON


@each_robot
@pytest.mark.parametrize("planner", [plan_fast, plan_minimum_snap, plan_rrt])
def test_ends_that_are_occupied_or_no_numbers_are_refused(robot: Robot, planner: Callable):
    inside = RigidState.at_rest((0.0, 0.0, 0.4))
    nowhere = RigidState.at_rest((float("nan"), 0.0, 0.4))
    refused = (InvalidInputError,) if robot.planar and planner is plan_rrt else (InvalidInputError, OccupiedError)
    for goal in (inside, nowhere):
        with pytest.raises(refused):
            next(planner(PlanProblem(ball(), robot, LEFT, goal)))


@pytest.mark.parametrize("planner", [plan_fast, plan_minimum_snap])
@pytest.mark.parametrize("name", [name for name, robot in SMALL.items() if robot.planar])
def test_every_planner_refuses_a_goal_in_the_air_for_a_robot_on_the_ground(planner: Callable, name: str):
    goal = RigidState.at_rest((0.7, 0.0, 0.8))
    with pytest.raises(InvalidInputError, match="stays at the height of its start"):
        next(planner(PlanProblem(ball(), SMALL[name], LEFT, goal)))
