"""What the planner counts on, for every robot there is."""

import pytest
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry import so3
from nerfnav.robots.robot import Robot, limit_uses
from nerfnav.robots.state import RigidState
from tests.robots.motions import DT, EVERY, PARTS, STEPS, eased, ends, free_numbers, largest_difference, rolled_out

each_robot = pytest.mark.parametrize("robot", EVERY.values(), ids=EVERY)


@each_robot
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("spread", [0.0, 0.1, 1.0])
def test_any_free_numbers_meet_both_ends_and_obey_the_dynamics(robot: Robot, seed: int, spread: float):
    between = ends(robot, seed)
    motion = robot.motion(free_numbers(robot, between, spread, seed), *between, STEPS, DT)
    assert largest_difference(motion.states[0], between[0]) < 1e-12
    assert largest_difference(motion.states[-1], between[1]) < 1e-12
    assert largest_difference(rolled_out(robot, motion), motion.states) < 1e-8


@each_robot
@pytest.mark.parametrize("seed", range(4))
def test_in_single_precision_planned_actions_reproduce_planned_states(robot: Robot, seed: int):
    start, goal = (state.to(torch.float32) for state in ends(robot, seed))
    free = free_numbers(robot, ends(robot, seed), 0.02, seed).float()
    motion = robot.motion(free, start, goal, STEPS, DT)
    assert largest_difference(rolled_out(robot, motion), motion.states) < 1e-4


@each_robot
@pytest.mark.parametrize("case", ["on the way", "standing still", "half a turn"])
def test_derivatives_agree_with_finite_differences(robot: Robot, case: str):
    start, goal = ends(robot, still=case != "on the way", goal_yaw=0.4 + torch.pi if case == "half a turn" else 0.9)
    between = (start, start) if case == "standing still" else (start, goal)
    free = free_numbers(robot, between).requires_grad_()

    def everything(numbers: torch.Tensor) -> tuple[torch.Tensor, ...]:
        motion = robot.motion(numbers, *between, STEPS, DT)
        return (*(getattr(motion.states, part) for part in PARTS), motion.actions, robot.limits(motion))

    first = next(other for other in EVERY.values() if type(other) is type(robot))
    # in all directions for the first of each class, in a random one for those that only have other numbers; but where
    # they stand still, too little is left of a step along one direction to tell
    random = robot is not first and case != "standing still"
    assert torch.autograd.gradcheck(everything, (free,), atol=1e-5, fast_mode=random)


@each_robot
def test_a_batch_of_free_numbers_gives_the_batch_of_their_motions(robot: Robot):
    between = ends(robot)
    free = torch.stack([free_numbers(robot, between, 0.1, seed) for seed in range(6)])
    batch = robot.motion(free.reshape(2, 3, -1), *between, STEPS, DT)
    for index in range(6):
        alone = robot.motion(free[index], *between, STEPS, DT)
        found = batch.states.map(lambda tensor: tensor.flatten(0, 1))[index]
        assert largest_difference(found, alone.states) < 1e-8


@each_robot
def test_the_motion_along_waypoints_stays_near_them(robot: Robot):
    start, goal = ends(robot, still=True, goal_yaw=0.5)
    motion = robot.motion(free_numbers(robot, (start, goal)), start, goal, STEPS, DT)
    line = start.position + eased() * (goal.position - start.position)
    assert (motion.states.position - line).norm(dim=-1).max() < 0.2


@each_robot
def test_robots_that_stay_on_the_ground_stay_level_and_at_their_height(robot: Robot):
    between = ends(robot)
    states = robot.motion(free_numbers(robot, between, 0.3), *between, STEPS, DT).states
    level = (states.rotation[:, 2, 2] - 1).abs().max() < 1e-9
    assert bool(level and (states.position[:, 2] == states.position[0, 2]).all()) is robot.planar


@each_robot
def test_what_is_bounded_is_asked_and_penalised_exactly_where_it_is_exceeded(robot: Robot):
    rest = ends(robot, still=True, goal_yaw=0.5)
    calm = robot.motion(free_numbers(robot, (rest[0], rest[0])), rest[0], rest[0], STEPS, DT)
    assert not any(use.violated for use in limit_uses(robot, calm)) and robot.limits(calm) == 0
    wild = robot.motion(free_numbers(robot, rest, 5.0), *rest, STEPS, DT)
    assert any(use.violated for use in limit_uses(robot, wild)) and robot.limits(wild) > 0
    assert {bound.name for bound in robot.bounds} == set(robot.demands(calm))


@each_robot
def test_too_few_steps_and_a_wrong_count_of_numbers_are_refused(robot: Robot):
    between = ends(robot)
    with pytest.raises(InvalidInputError, match=f"at least {robot.minimum_steps} steps"):
        robot.motion(torch.zeros(3), *between, robot.minimum_steps - 1, DT)
    count = robot.free_numbers(STEPS)  # type: ignore[attr-defined]
    with pytest.raises(InvalidInputError, match=f"{count} free numbers, not {count + 1}"):
        robot.motion(torch.zeros(count + 1), *between, STEPS, DT)


@each_robot
def test_another_body_changes_nothing_else(robot: Robot):
    other = robot.with_body(robot.body.grown(0.01))
    assert other.body.extents[0] == pytest.approx(robot.body.extents[0] + 0.02)
    assert type(other) is type(robot) and other.bounds == robot.bounds and robot.body is not other.body


@each_robot
def test_the_room_around_a_robot_on_the_ground_does_not_reach_into_the_ground(robot: Robot):
    room = robot.body_with_room(0.05)
    rise = 0.0 if robot.planar else 0.1
    assert room.extents[0] == pytest.approx(robot.body.extents[0] + 0.1)
    assert room.extents[2] == pytest.approx(robot.body.extents[2] + rise)


@each_robot
def test_a_settled_state_is_one_that_the_robot_can_go_on_from(robot: Robot):
    start, goal = ends(robot)
    noise = 0.05 * torch.randn(12, generator=torch.Generator().manual_seed(3), dtype=torch.float64)
    settled = robot.settled(start.retract(noise), start)
    assert (settled.position - start.position).norm() < 0.2
    robot.check_ends(settled, goal)
    assert largest_difference(robot.settled(settled, start), settled) < 1e-12


def test_a_quadrotor_is_nowhere_put_right():
    state, _ = ends(EVERY["quadrotor"])
    assert EVERY["quadrotor"].settled(state, RigidState.at_rest((0, 0, 0))) is state


@each_robot
@pytest.mark.parametrize("seed", range(4))
def test_a_robot_that_holds_comes_to_rest_level_and_stays(robot: Robot, seed: int):
    state, _ = ends(robot, seed)
    noise = torch.tensor([0.0] * 3 + [0.6] * 3 + [0.2] * 3 + [0.6] * 3, dtype=torch.float64)
    pushed = state.retract(noise * torch.randn(12, generator=torch.Generator().manual_seed(seed), dtype=torch.float64))
    states = [robot.settled(pushed, state)]
    for _ in range(30):
        states.append(robot.step(states[-1], robot.hold(states[-1], DT), DT))
    for part in ("velocity", "body_rate"):
        assert getattr(states[-1], part).norm() < 0.01, part
    assert states[-1].rotation[2, 2] > 0.999
    assert (states[-1].position - states[0].position).norm() < 1.2


@each_robot
def test_a_robot_at_rest_holds_where_it_is(robot: Robot):
    rest = RigidState.at_rest((0.1, 0.2, 0.5), 0.7)
    after = rest
    for _ in range(10):
        after = robot.step(after, robot.hold(after, DT), DT)
    assert largest_difference(after, rest) < 1e-5


@each_robot
def test_a_robot_that_looks_around_turns_on_the_spot(robot: Robot):
    states = [RigidState.at_rest((0.1, 0.2, 0.5), 0.7)]
    for _ in range(12):
        states.append(robot.step(states[-1], robot.hold(states[-1], DT, turn=1.5), DT))
    assert states[-1].body_rate[2].item() == pytest.approx(1.5, rel=0.02)
    turned = so3.local(states[0].rotation, states[-1].rotation)
    assert turned[2].item() == pytest.approx(1.5 * 1.2, abs=0.4) and turned[:2].norm() < 1e-3
    assert (states[-1].position - states[0].position).norm() < 1e-3
