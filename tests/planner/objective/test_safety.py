"""What a plan risks: bounds, room, and verdicts."""

import pytest
import torch

from nerfnav.field.core.occupancy import SOLID_DENSITY
from nerfnav.field.models.analytic import BallsField
from nerfnav.planner.objective.problem import PlanProblem
from nerfnav.planner.objective.safety import SafetyConfig, assess_safety, judge_search, measure_clearance
from nerfnav.planner.risk.costs import PathDensity, collision_per_step
from nerfnav.planner.steps import PlanCost, PlanOutcome
from nerfnav.robots.body import Body
from nerfnav.robots.state import Motion, RigidState
from tests.planner.places import BOX, ROBOT, Fog, Wall, ball, straight_motion

POINT = Body.box((1e-3, 1e-3, 1e-3), (1, 1, 1))
PAST, THROUGH = straight_motion((-0.7, 0.4, 0.4), (0.7, 0.4, 0.4), 14), straight_motion((-0.7, 0, 0.4), (0.7, 0, 0.4))
FINE = PlanCost(0.0, 1.0, 0.0)


def test_the_bound_is_the_sum_of_its_steps_and_the_worst_one_is_named():
    motion = straight_motion((-0.7, 0.0, 0.66), (0.7, 0.0, 0.66), 14)
    safety = assess_safety(ball(), motion, POINT)
    finely = collision_per_step(ball(), motion, POINT, 20)
    torch.testing.assert_close(safety.per_step.float(), finely, rtol=0.05, atol=1e-3)
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


def test_a_wall_between_two_waypoints_counts_wherever_it_stands_in_the_step():
    """A wall of 4 cm in one step of 60 cm: three densities a step miss it, and both ends are 20 cm away from it."""
    wall, step = Wall(door=0.0, thickness=0.04), straight_motion((-0.2, 0, 0.5), (0.4, 0, 0.5), 1)
    assert collision_per_step(wall, step, POINT, 3).item() < 0.1
    assert PathDensity.of(wall, step, POINT).bound_per_step.item() > 1
    assert measure_clearance(wall, step, POINT, SafetyConfig()) == 0.0
    problem = PlanProblem(wall, ROBOT, RigidState.at_rest((-0.2, 0, 0.5)), RigidState.at_rest((0.4, 0, 0.5)))
    assert judge_search(problem, step, FINE, PlanOutcome.CONVERGED) is PlanOutcome.IN_COLLISION


def test_corners_of_a_body_that_turns_are_judged_on_their_arcs():
    """Half a turn in one step: the chords of a plate's corners go through its middle, its arcs do not."""
    plate = Body.box((0.4, 0.02, 0.02), (21, 1, 1))
    half = Motion(
        RigidState.stack([RigidState.at_rest((0, 0, 0.4), yaw) for yaw in (0.0, 3.0)]), torch.zeros(1, 4), 0.1
    )
    post = BallsField(BOX, torch.tensor([[0.0, 0.17, 0.4]]), torch.tensor([0.03]))
    assert collision_per_step(post, half, plate, 3).item() < 0.1
    assert PathDensity.of(post, half, plate).bound_per_step.item() > 1
    assert measure_clearance(post, half, plate, SafetyConfig()) == 0.0


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
