"""What a plan risks: bounds, room, and verdicts."""

import pytest
import torch

from nerfnav.field.core.occupancy import SOLID_DENSITY
from nerfnav.planner.objective.problem import PlanProblem
from nerfnav.planner.objective.safety import SafetyConfig, assess_safety, judge_search, measure_clearance
from nerfnav.planner.risk.costs import collision_per_step
from nerfnav.planner.steps import PlanCost, PlanOutcome
from nerfnav.robots.body import Body
from nerfnav.robots.state import RigidState
from tests.planner.places import ROBOT, Fog, ball, straight_motion

POINT = Body.box((1e-3, 1e-3, 1e-3), (1, 1, 1))
PAST, THROUGH = straight_motion((-0.7, 0.4, 0.4), (0.7, 0.4, 0.4), 14), straight_motion((-0.7, 0, 0.4), (0.7, 0, 0.4))
FINE = PlanCost(0.0, 1.0, 0.0)


def test_the_bound_is_the_sum_of_its_steps_and_the_worst_one_is_named():
    motion = straight_motion((-0.7, 0.0, 0.66), (0.7, 0.0, 0.66), 14)
    safety = assess_safety(ball(), motion, POINT)
    torch.testing.assert_close(safety.per_step, collision_per_step(ball(), motion, POINT, 3))
    assert safety.bound == pytest.approx(min(1.0, safety.per_step.sum().item()))
    assert safety.worst_step in (6, 7)  # over the top of the ball
    assert safety.per_step[safety.worst_step] == safety.per_step.max()


def test_a_bound_is_at_most_one():
    assert assess_safety(ball(), THROUGH, ROBOT.body).bound == 1.0


def test_the_clearance_is_the_distance_from_the_level_set():
    away = torch.linspace(0.2, 0.4, 2001)
    density = ball().density(torch.stack([torch.zeros(2001), away, torch.full((2001,), 0.4)], -1))
    radius = away[density > SOLID_DENSITY].max().item()  # a little more than 0.25: its edge is soft
    found = measure_clearance(ball(), PAST, POINT, SafetyConfig(reach=0.5))
    assert found == pytest.approx(0.4 - radius, abs=0.015)
    assert measure_clearance(ball(), PAST, ROBOT.body, SafetyConfig()) < found
    assert measure_clearance(ball(), THROUGH, POINT, SafetyConfig()) == 0.0


def test_where_nothing_dense_is_near_there_is_no_clearance_to_tell():
    assert measure_clearance(Fog(rho=0.1), PAST, POINT, SafetyConfig()) is None
    assert measure_clearance(ball(), PAST, POINT, SafetyConfig(reach=0.1)) is None


@pytest.mark.parametrize(
    ("field", "motion", "cost", "expected"),
    [
        (ball(), PAST, FINE, PlanOutcome.CONVERGED),
        (ball(), THROUGH, FINE, PlanOutcome.IN_COLLISION),
        (Fog(rho=3.0), PAST, FINE, PlanOutcome.LIKELY_COLLISION),  # nothing is dense, but the bound is hopeless
        (Fog(rho=1e-4), PAST, FINE, PlanOutcome.CONVERGED),
        (ball(), straight_motion((-0.7, 0.7, 0.4), (0.7, 0.7, 0.4), 2), FINE, PlanOutcome.CONVERGED),
        (ball(), PAST, PlanCost(float("nan"), 1.0, 0.0), PlanOutcome.DIVERGED),
    ],
)
def test_a_verdict_names_what_is_wrong(field: object, motion: object, cost: PlanCost, expected: PlanOutcome):
    ends = RigidState.at_rest((-0.7, 0.4, 0.4)), RigidState.at_rest((0.7, 0.4, 0.4))
    problem = PlanProblem(field, ROBOT, *ends)  # type: ignore[arg-type]
    assert judge_search(problem, motion, cost, PlanOutcome.CONVERGED) is expected  # type: ignore[arg-type]
