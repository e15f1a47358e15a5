"""Couch and differential drive: what their dynamics allow, and what is refused."""

import math

import pytest
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.robots.arcs import displacements
from nerfnav.robots.couch import Couch, CouchConfig
from nerfnav.robots.diffdrive import DiffDrive
from nerfnav.robots.ground import headings_along, unwrap_angles, wrap_angle
from nerfnav.robots.robot import Robot
from nerfnav.robots.state import Motion, RigidState
from tests.robots.motions import DT, STEPS, ends, free_numbers

GROUND = (Couch(), DiffDrive())
each_robot = pytest.mark.parametrize("robot", GROUND, ids=lambda robot: robot.name)


def along(robot: Robot, places: list[tuple[float, float]], start_yaw: float, goal_yaw: float) -> Motion:
    """A motion from rest to rest that is encoded from places on the ground, evenly in time."""
    points = torch.tensor([(*place, 0.1) for place in places], dtype=torch.float64)
    start, goal = (RigidState.at_rest((*place, 0.1), yaw) for place, yaw in
                   ((places[0], start_yaw), (places[-1], goal_yaw)))  # fmt: skip
    start, goal = start.to(torch.float64), goal.to(torch.float64)
    yaws = torch.linspace(start_yaw, goal_yaw, len(places), dtype=torch.float64)[:, None]
    free = robot.encode(torch.cat([points, yaws], -1), start, goal, DT)
    return robot.motion(free, start, goal, len(places) - 1, DT)


def lateral(motion: Motion) -> float:
    states = motion.states
    return (states.rotation[..., 1] * states.velocity).sum(-1).abs().max().item()


def test_a_force_moves_the_couch_where_it_points_whatever_its_heading():
    state = RigidState.at_rest((0, 0, 0.1), 1.2)
    pushed = Couch(CouchConfig(mass=2.0)).step(state, torch.tensor([1.0, -2.0, 0.0]), 0.5)
    torch.testing.assert_close(pushed.velocity, torch.tensor([0.25, -0.5, 0.0]))
    assert Couch().step(state, torch.tensor([0.0, 0.0, 1e-3]), DT).body_rate[2] > 0


def test_the_points_of_the_couch_leave_no_room_for_a_bar_of_two_centimetres():
    body = Couch().body
    assert len(body.points_body) <= 500
    for axis in range(3):
        gaps = body.points_body[:, axis].unique().diff() - 0.02  # between rows of points, the bar's width away
        assert (gaps < 0.006).all()


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("spread", [0.0, 0.3, 3.0])
def test_wheels_never_slide(seed: int, spread: float):
    robot = DiffDrive()
    between = ends(robot, seed)
    motion = robot.motion(free_numbers(robot, between, spread, seed), *between, STEPS, DT)
    assert lateral(motion) < 1e-12
    start, goal = (state.to(torch.float32) for state in between)
    single = robot.motion(free_numbers(robot, between, spread, seed).float(), start, goal, STEPS, DT)
    assert lateral(single) < 1e-6 * max(1.0, single.states.velocity.norm(dim=-1).max().item())


def test_a_goal_behind_is_reached_in_reverse_and_one_ahead_forward():
    places = [(0.05 * k, 0.0) for k in range(STEPS + 1)]
    ahead, behind = along(DiffDrive(), places, 0.0, 0.0), along(DiffDrive(), places, math.pi, math.pi)
    for motion, gear in ((ahead, 1.0), (behind, -1.0)):
        speeds = (motion.states.rotation[..., 0] * motion.states.velocity).sum(-1)
        assert (gear * speeds[1:-1] > 0.1).all()


def test_a_drive_may_stop_in_the_middle_and_go_back():
    robot = DiffDrive()
    start = RigidState.at_rest((0.0, 0.0, 0.1)).to(torch.float64)
    speeds = torch.tensor([0.5, 0.5, 0.5, 0.0, 0.0, -0.5, -0.5, -0.5], dtype=torch.float64)
    free = torch.cat([speeds, torch.zeros(7, dtype=torch.float64)]).requires_grad_()
    motion = robot.motion(free, start, start, 9, DT)
    torch.testing.assert_close(motion.states.velocity[1:-1, 0], speeds)
    (motion.states.position.square().sum() + motion.actions.square().sum()).backward()
    assert free.grad is not None and torch.isfinite(free.grad).all()


def test_standing_still_takes_no_action():
    for robot in GROUND:
        state = RigidState.at_rest((0.3, 0.2, 0.1), 2.0)
        motion = robot.motion(robot.encode(torch.tensor([0.3, 0.2, 0.1, 2.0]).expand(STEPS + 1, 4), state, state, DT),
                              state, state, STEPS, DT)  # fmt: skip
        assert motion.actions.abs().max() < 1e-4


def test_each_step_of_a_drive_is_an_arc_of_its_speed_and_turn():
    q = displacements(torch.tensor([2.0]), torch.tensor([0.0, math.pi / 2]), 0.5)[0]
    radius = 2.0 * 0.5 / (math.pi / 2)  # a quarter of a circle, one metre long
    torch.testing.assert_close(q, torch.tensor([radius, radius]))


@each_robot
def test_ends_in_the_air_tilted_or_at_two_heights_are_refused(robot: Robot):
    flat, high = RigidState.at_rest((0, 0, 0.1)), RigidState.at_rest((1, 0, 0.3))
    with pytest.raises(InvalidInputError, match=r"stays at the height of its start, 0\.100 m.* 0\.300 m"):
        robot.check_ends(flat, high)
    for axis in (5, 6, 9):  # rising, rolled, rolling
        tangent = torch.zeros(12)
        tangent[axis] = 0.2
        with pytest.raises(InvalidInputError, match="must be level"):
            robot.check_ends(flat.retract(tangent), flat)


def test_a_drive_that_slides_at_its_start_is_refused():
    flat, tangent = RigidState.at_rest((0, 0, 0.1)), torch.zeros(12)
    tangent[4] = 0.2
    with pytest.raises(InvalidInputError, match="its start moves across its heading"):
        DiffDrive().check_ends(flat.retract(tangent), flat)


def test_headings_follow_the_way_and_turn_to_the_ends():
    moved = torch.tensor([[0.0, 1e-9], [1.0, 0.0], [1.0, 0.0], [1.0, 1.0], [1.0, 1.0], [0.0, 0.0]])
    yaw, gear = headings_along(moved, torch.tensor(0.3), torch.tensor(1.0))
    assert gear == 1.0 and len(yaw) == 7
    torch.testing.assert_close(yaw[[0, -1]], torch.tensor([0.3, 1.0]))
    torch.testing.assert_close(yaw[3], torch.tensor(math.pi / 8))


def test_angles_are_wrapped_and_unwrapped():
    torch.testing.assert_close(
        wrap_angle(torch.tensor([3.5, -7.0])), torch.tensor([3.5 - 2 * math.pi, 2 * math.pi - 7])
    )
    angles = unwrap_angles(torch.tensor([3.0, -3.0, 3.0]))
    torch.testing.assert_close(angles, torch.tensor([3.0, 2 * math.pi - 3.0, 3.0]))
