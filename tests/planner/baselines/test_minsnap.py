"""Minimum snap against its optimality conditions, and against other people's solvers."""

import json
import os
from pathlib import Path

import pytest
import torch

from nerfnav import robots
from nerfnav.core.errors import InvalidInputError
from nerfnav.core.steps import run_steps
from nerfnav.planner.baselines.minsnap import arrival_times, minimum_snap, plan_minimum_snap, turning_points
from nerfnav.planner.objective.problem import PlanProblem
from nerfnav.planner.objective.safety import SafetyConfig, measure_clearance
from nerfnav.planner.solvers.fast import plan_fast
from nerfnav.planner.steps import PlanOutcome
from nerfnav.robots.state import RigidState
from tests.planner.places import ROBOT, Wall, across, ball

POINTS = torch.tensor([[0.0, 0, 0.2], [0.5, 0.1, 0.3], [0.6, 0.7, 0.1], [1.2, 0.9, 0.5]], dtype=torch.float64)
TIMES = torch.tensor([0.0, 0.6, 1.5, 2.1])


@pytest.mark.skipif("NERFNAV_TEST_DATA" not in os.environ, reason="needs NERFNAV_TEST_DATA: reference trajectories")
def test_it_agrees_with_another_solver() -> None:
    cases = json.loads((Path(os.environ["NERFNAV_TEST_DATA"]) / "oracles" / "minsnap.json").read_text())["cases"]
    assert len(cases) == 4
    for case in cases:
        points, times, at = (torch.tensor(case[key], dtype=torch.float64) for key in ("waypoints", "times", "t"))
        curve = minimum_snap(points, times)
        expected = torch.tensor(case["pos"], dtype=torch.float64)
        assert (curve(at) - expected).abs().max() < 1e-6
        velocity = torch.tensor(case["vel"], dtype=torch.float64)
        assert (curve(at, 1) - velocity).abs().max() < 1e-5 * velocity.abs().max()


def test_the_curve_passes_its_points_and_rests_at_its_ends() -> None:
    curve = minimum_snap(POINTS, TIMES)
    assert torch.allclose(curve(TIMES), POINTS, atol=1e-9)
    for order in (1, 2, 3):
        assert curve(TIMES[[0, -1]], order).abs().max() < 1e-7


def test_it_leaves_and_arrives_at_the_given_velocities() -> None:
    leaving, arriving = torch.tensor([0.3, -0.2, 0.1]), torch.tensor([0.0, 0.5, 0.0])
    curve = minimum_snap(POINTS, TIMES, leaving, arriving)
    assert torch.allclose(curve(TIMES[[0, -1]], 1), torch.stack([leaving, arriving]).double(), atol=1e-7)


@pytest.mark.parametrize("order", [1, 2, 3, 4, 5, 6])
def test_derivatives_are_continuous_at_inner_points(order: int) -> None:
    curve = minimum_snap(POINTS, TIMES)
    before, after = curve(TIMES.double() - 1e-9, order)[1:-1], curve(TIMES.double() + 1e-9, order)[1:-1]
    # to snap as a constraint; the fifth and sixth by optimality, which makes this a test of the whole solution
    assert torch.allclose(before, after, rtol=1e-5, atol=1e-4 * float(curve(TIMES, order).abs().max()))


def test_a_derivative_is_the_slope_of_the_one_below() -> None:
    curve, at, h = minimum_snap(POINTS, TIMES), torch.linspace(0.1, 2.0, 7).double(), 1e-5
    for order in range(4):
        slope = (curve(at + h, order) - curve(at - h, order)) / (2 * h)
        assert torch.allclose(curve(at, order + 1), slope, rtol=1e-4, atol=1e-3)


@pytest.mark.parametrize("times", [[0.0, 0.6, 0.6, 2.1], [0.0, 1.5, 0.6, 2.1]])
def test_times_that_do_not_rise_are_refused(times: list[float]) -> None:
    with pytest.raises(InvalidInputError, match="later time"):
        minimum_snap(POINTS, torch.tensor(times))


def test_turning_points_keep_corners_and_drop_what_lies_on_lines() -> None:
    leg = torch.linspace(0, 1, 11)[:, None]
    path = torch.cat([leg * torch.tensor([1.0, 0, 0]), torch.tensor([1.0, 0, 0]) + leg * torch.tensor([0, 1.0, 0])])
    assert turning_points(path, 0.02).tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0]]


def test_arrival_times_rise_and_span_the_horizon() -> None:
    times = arrival_times(POINTS.float(), 20, 0.1)
    assert (times.diff() > 0).all()
    assert times[0] == pytest.approx(0.2) and times[-1] == pytest.approx(2.0)


def test_a_plan_meets_its_ends_and_obeys_the_dynamics() -> None:
    problem = across(ball(0.15), height=0.5)  # with room below and above
    step = plan_minimum_snap(problem)
    assert step.outcome is PlanOutcome.CONVERGED
    state = problem.start
    for t, action in enumerate(step.motion.actions):
        state = ROBOT.step(state, action, problem.dt)
        assert torch.allclose(state.position, step.motion.states.position[t + 1], atol=1e-4)
    assert problem.goal.local(state).abs().max() < 1e-3


def test_a_way_through_a_door_is_followed() -> None:
    step = plan_minimum_snap(across(Wall(door=0.6)))
    position = step.motion.states.position
    assert position[position[:, 0].abs().argmin(), 1] > 0.2


def test_a_wall_without_a_door_has_no_path() -> None:
    step = plan_minimum_snap(across(Wall(door=0.0)))
    assert step.outcome is PlanOutcome.NO_PATH
    assert torch.isfinite(step.motion.states.position).all()


def test_resting_where_the_goal_is_gives_a_motion_that_hovers() -> None:
    problem = across(ball())
    here = RigidState.at_rest((-0.7, 0.0, 0.4))
    step = plan_minimum_snap(type(problem)(problem.field, ROBOT, here, here))
    assert (step.motion.states.position - here.position).norm(dim=-1).max() < 1e-3


def couch_through(wall: Wall) -> PlanProblem:
    """A couch that stands across the way on one side of a wall, and shall on the other."""
    start, goal = RigidState.at_rest((-0.6, 0.5, 0.4), 1.57), RigidState.at_rest((0.6, 0.5, 0.4), 1.57)
    return PlanProblem(wall, robots.load("couch"), start, goal, 40)


def test_an_elongated_ground_robot_turns_to_pass_a_door_that_it_fits_only_lengthwise() -> None:
    problem = couch_through(Wall(door=0.36, thickness=0.1))  # 0.3 m of couch and the map's margins do not fit across
    step = plan_minimum_snap(problem)
    assert step.outcome is PlanOutcome.CONVERGED
    states = step.motion.states
    in_door = states.position[:, 0].abs().argmin()
    assert abs(states.rotation[in_door, 0, 0]) > 0.95, "its long side points through the door"
    clearance = measure_clearance(problem.field, step.motion, problem.robot.body, SafetyConfig())
    assert clearance is not None and clearance > 0.05
    assert (states.position[:, 2] - 0.4).abs().max() < 1e-5


@pytest.mark.slow
def test_a_curve_whose_heading_swings_into_the_frame_of_a_narrow_door_is_in_collision() -> None:
    problem = couch_through(Wall(door=0.24))
    step = plan_minimum_snap(problem)
    states = step.motion.states
    in_door = states.position[:, 0].abs() < 0.1
    assert (states.rotation[in_door, 0, 0].abs() > 0.8).all(), "it turns, as the path does, but swings on: 0.45 rad"
    assert measure_clearance(problem.field, step.motion, problem.robot.body, SafetyConfig()) == 0
    assert step.outcome is PlanOutcome.IN_COLLISION
    optimised = run_steps(plan_fast(problem))
    clearance = measure_clearance(problem.field, optimised.motion, problem.robot.body, SafetyConfig())
    assert clearance is not None and clearance > 0.02, "there is a way, which minimum snap does not keep to"
