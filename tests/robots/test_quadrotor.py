"""The quadrotor: flatness map, dynamics, and both against each other and against another simulator."""

import json
import math
import os
from pathlib import Path

import pytest
import torch

from nerfnav import robots
from nerfnav.core.errors import InvalidInputError, UnknownNameError
from nerfnav.geometry import so3
from nerfnav.robots.quadrotor import Quadrotor, QuadrotorConfig
from nerfnav.robots.robot import penalty
from nerfnav.robots.state import Motion, RigidState

STEPS, DT = 20, 0.1
ROBOT = Quadrotor()
PARTS = ("position", "velocity", "rotation", "body_rate")


def moving(position: tuple[float, float, float], yaw: float, seed: int) -> RigidState:
    """A tilted, moving state near rest."""
    generator = torch.Generator().manual_seed(seed)
    return RigidState.at_rest(position, yaw).retract(
        torch.randn(12, generator=generator) * torch.tensor([0.0] * 3 + [0.2] * 3 + [0.1] * 3 + [0.3] * 3)
    )


def free_along_a_line(
    start: RigidState, goal: RigidState, steps: int = STEPS, seed: int = 0, noise: float = 0.02
) -> torch.Tensor:
    """Random free numbers around an eased line from start to goal."""
    generator = torch.Generator().manual_seed(seed)
    time = torch.linspace(0, 1, steps + 1, dtype=start.position.dtype)
    share = (time**2 * (3 - 2 * time))[:, None]
    line = start.position + share * (goal.position - start.position)
    line = line + noise * torch.randn(steps + 1, 3, generator=generator).to(line)
    yaws = torch.randn(steps + 1, 1, generator=generator).to(line) * 0.1 + 3 * share
    return ROBOT.encode(torch.cat([line, yaws], -1), start, goal, DT)


def rolled_out(motion: Motion) -> RigidState:
    states = [motion.states[0]]
    for action in motion.actions:
        states.append(ROBOT.step(states[-1], action, motion.dt))
    return RigidState.stack(states)


def largest_difference(states: RigidState, others: RigidState) -> float:
    return max((getattr(states, part) - getattr(others, part)).abs().max().item() for part in PARTS)


@pytest.mark.parametrize("seed", range(8))
def test_rolling_the_planned_actions_reproduces_the_planned_states(seed: int):
    start, goal = moving((0.4, -0.7, 0.2), 1.0, seed), moving((-0.4, 0.5, 0.16), -2.0, seed + 100)
    motion = ROBOT.motion(free_along_a_line(start, goal, seed=seed), start, goal, STEPS, DT)
    assert largest_difference(rolled_out(motion), motion.states) < 1e-4


def test_in_double_precision_only_rounding_is_left():
    start, goal = moving((0.4, -0.7, 0.2), 1.0, 0), moving((-0.4, 0.5, 0.16), -2.0, 1)
    start, goal = (RigidState(s.position, s.velocity, so3.project(s.rotation), s.body_rate)
                   for s in (start.to(torch.float64), goal.to(torch.float64)))  # fmt: skip
    motion = ROBOT.motion(free_along_a_line(start, goal), start, goal, STEPS, DT)
    assert largest_difference(rolled_out(motion), motion.states) < 1e-11


@pytest.mark.parametrize("steps", [4, 5, 20])
def test_any_free_numbers_meet_start_and_goal_exactly(steps: int):
    start, goal = moving((0.0, 0.0, 0.3), 0.5, 2), moving((0.1, 0.1, 0.3), 0.3, 3)
    free = torch.randn(ROBOT.free_numbers(steps), generator=torch.Generator().manual_seed(4)) * 0.1 + 1
    motion = ROBOT.motion(free, start, goal, steps, DT)
    assert motion.actions.shape == (steps, 4)
    assert largest_difference(motion.states[0], start) == 0
    assert largest_difference(motion.states[-1], goal) == 0


def test_twenty_steps_leave_68_numbers_free():
    assert ROBOT.free_numbers(20) == 68
    assert ROBOT.free_numbers(4) == 4


def test_a_batch_of_free_numbers_gives_the_batch_of_their_motions():
    start, goal = moving((0.4, -0.7, 0.2), 1.0, 0), moving((-0.4, 0.5, 0.16), -2.0, 1)
    free = torch.stack([free_along_a_line(start, goal, seed=seed) for seed in range(6)])
    batch = ROBOT.motion(free.reshape(2, 3, -1), start, goal, STEPS, DT)
    assert batch.actions.shape == (2, 3, STEPS, 4)
    for row in range(6):
        alone = ROBOT.motion(free[row], start, goal, STEPS, DT)
        found = batch.states.map(lambda tensor: tensor.flatten(0, 1))[row]
        assert largest_difference(found, alone.states) < 1e-5
        torch.testing.assert_close(batch.actions.flatten(0, 1)[row], alone.actions, rtol=1e-4, atol=1e-5)


def test_derivatives_agree_with_finite_differences():
    start, goal = (moving(*end).to(torch.float64) for end in (((0, 0, 0.3), 0.5, 2), ((0.4, 0.2, 0.3), 3.0, 3)))
    free = free_along_a_line(start, goal, 7).requires_grad_()

    def everything(numbers: torch.Tensor) -> tuple[torch.Tensor, ...]:
        motion = ROBOT.motion(numbers, start, goal, 7, DT)
        return (*(getattr(motion.states, part) for part in PARTS), motion.actions, ROBOT.limits(motion))

    assert torch.autograd.gradcheck(everything, (free,), atol=1e-6)


@pytest.mark.parametrize("yaw", [math.pi, -math.pi, 3.1415927, 11 * math.pi])
def test_a_half_turn_of_yaw_is_a_heading_like_any_other(yaw: float):
    start, goal = RigidState.at_rest((0, 0, 0.3), yaw), RigidState.at_rest((0.5, 0, 0.3), yaw)
    waypoints = torch.cat([torch.linspace(0, 1, 21)[:, None] * (goal.position - start.position) + start.position,
                           torch.full((21, 1), yaw)], -1)  # fmt: skip
    free = ROBOT.encode(waypoints, start, goal, DT).requires_grad_()
    motion = ROBOT.motion(free, start, goal, STEPS, DT)
    motion.actions.square().sum().backward()
    assert free.grad is not None and torch.isfinite(free.grad).all()
    assert motion.states.body_rate[..., 2].abs().max() < 0.5
    assert (motion.states.rotation[:, 0, 0] < -0.5).all()


def test_falling_freely_has_finite_states_and_derivatives():
    start, goal = RigidState.at_rest((0, 0, 2.0)), RigidState.at_rest((0, 0, 0))
    time = torch.arange(21)
    heights = 2.0 - 9.81 * DT**2 * time * (time - 1) / 2  # free fall as explicit Euler knows it
    waypoints = torch.stack([torch.zeros(21), torch.zeros(21), heights, torch.zeros(21)], -1)
    free = ROBOT.encode(waypoints, start, goal, DT)
    free[:2] = 0
    free[2:50] = waypoints[4:20, :3].flatten()
    free.requires_grad_()
    motion = ROBOT.motion(free, start, goal, STEPS, DT)
    assert motion.actions[2:17, 0].max() < 1e-3
    (motion.actions.square().sum() + ROBOT.limits(motion) + motion.states.rotation.sum()).backward()
    assert free.grad is not None and torch.isfinite(free.grad).all()
    for part in PARTS:
        assert torch.isfinite(getattr(motion.states, part)).all()
    identity = motion.states.rotation @ motion.states.rotation.transpose(-1, -2)
    torch.testing.assert_close(identity, torch.eye(3).expand_as(identity), rtol=0, atol=1e-5)


def test_hovering_takes_the_weight_and_no_torque():
    state = RigidState.at_rest((0.1, 0.2, 0.3), 0.7)
    waypoints = torch.tensor([0.1, 0.2, 0.3, 0.7]).expand(21, 4)
    motion = ROBOT.motion(ROBOT.encode(waypoints, state, state, DT), state, state, STEPS, DT)
    hover = torch.tensor([ROBOT.weight, 0, 0, 0])
    torch.testing.assert_close(motion.actions, hover.expand(20, 4), rtol=0, atol=2e-4)
    assert ROBOT.limits(motion) == 0


def test_losing_the_upward_thrust_is_penalised():
    start, goal = RigidState.at_rest((0, 0, 1.0)), RigidState.at_rest((0, 0, 0.5), 3.0)
    free = free_along_a_line(start, goal, noise=0)
    falling = free.clone()
    falling[:2] = 0.0

    def floor_term(numbers: torch.Tensor) -> torch.Tensor:
        motion = ROBOT.motion(numbers, start, goal, STEPS, DT)
        return ROBOT.limits(motion) - penalty(ROBOT, motion)

    assert floor_term(free) == 0
    assert floor_term(falling) >= 2 * ROBOT.config.thrust_floor**2 * 0.999


def test_encoding_a_motion_gives_back_its_free_numbers():
    start, goal = moving((0.4, -0.7, 0.2), 1.0, 0), moving((-0.4, 0.5, 0.16), -2.0, 1)
    free = free_along_a_line(start, goal, noise=0)
    states = ROBOT.motion(free, start, goal, STEPS, DT).states
    yaws = torch.cat([torch.zeros(2), free[-18:], torch.zeros(1)])[:, None]
    again = ROBOT.encode(torch.cat([states.position, yaws], -1), start, goal, DT)
    torch.testing.assert_close(again, free, rtol=0, atol=1e-4)


def test_the_way_under_given_actions_is_that_of_its_steps():
    start, actions = moving((0.1, 0.2, 0.3), 0.4, seed=1), torch.rand(12, 4, generator=torch.Generator().manual_seed(2))
    actions = (actions - 0.3) * torch.tensor([2 * ROBOT.weight, 1e-4, 1e-4, 1e-4])
    states = [start]
    for action in actions:
        states.append(ROBOT.step(states[-1], action, DT))
    way = torch.stack([state.position for state in states])
    torch.testing.assert_close(ROBOT.roll_out_positions(start, actions, DT), way, rtol=0, atol=1e-4)

    class Heavy(Quadrotor):
        """Takes its steps in its own way."""

        def step(self, state: RigidState, action: torch.Tensor, dt: float) -> RigidState:
            return super().step(state, 0.5 * action, dt)

    assert (Heavy().roll_out_positions(start, actions, DT)[-1] - way[-1]).norm() > 0.01


def test_tilting_keeps_the_heading_to_second_order():
    start, goal = RigidState.at_rest((0, 0, 0.3), 1.0), RigidState.at_rest((1.0, 0.6, 0.3), 1.0)
    time = torch.linspace(0, 1, 21)[:, None]
    share = time**3 * (10 - 15 * time + 6 * time**2)
    waypoints = torch.cat([start.position + share * (goal.position - start.position), torch.ones(21, 1)], -1)
    motion = ROBOT.motion(ROBOT.encode(waypoints, start, goal, DT), start, goal, STEPS, DT)
    tilt = torch.acos(motion.states.rotation[..., 2, 2].clamp_max(1))
    assert (so3.yaw_of(motion.states.rotation) - 1).abs().max() < 0.5 * tilt.max() ** 2


@pytest.mark.parametrize("steps", [-1, 0, 3])
def test_fewer_than_four_steps_are_refused(steps: int):
    state = RigidState.at_rest((0, 0, 0))
    with pytest.raises(InvalidInputError, match="at least 4 steps"):
        ROBOT.motion(torch.zeros(68), state, state, steps, DT)


def test_a_wrong_count_of_free_numbers_is_refused():
    state = RigidState.at_rest((0, 0, 0))
    with pytest.raises(InvalidInputError, match="20 steps have 68 free numbers, not 67"):
        ROBOT.motion(torch.zeros(67), state, state, STEPS, DT)


def test_a_positive_torque_turns_the_body_the_right_handed_way():
    state = RigidState.at_rest((0, 0, 0))
    for axis in range(3):
        action = torch.zeros(4)
        action[0], action[1 + axis] = ROBOT.weight, 1e-4
        rate = ROBOT.step(state, action, DT).body_rate
        assert rate[axis] > 0
        assert rate.abs().sum() == rate[axis]


def test_the_quadrotor_of_25_cm_is_a_solid_box_with_the_small_ones_share_of_thrust():
    large = robots.load("quadrotor25")
    assert isinstance(large, Quadrotor) and large.name == "quadrotor25"
    assert large.body.extents == (0.25, 0.25, 0.08) and large.config.mass == 0.7
    edges = torch.tensor(large.body.extents).square()
    box = large.config.mass / 12 * (edges.sum() - edges)
    assert torch.allclose(torch.tensor(large.config.inertia), box, rtol=0.02)
    share = large.config.max_thrust / large.weight
    assert share == pytest.approx(ROBOT.config.max_thrust / ROBOT.weight, rel=0.01)


def test_robots_are_loaded_by_name_and_unknown_ones_list_the_known():
    assert "quadrotor" in robots.names()
    assert isinstance(robots.load("quadrotor"), Quadrotor)
    with pytest.raises(UnknownNameError, match=r"no robot named 'zeppelin'; known are: .*quadrotor"):
        robots.load("zeppelin")


# -- against another simulator --------------------------------------------------------------------------------------


def flights() -> list[dict]:
    folder = Path(os.environ["NERFNAV_TEST_DATA"])
    return json.loads((folder / "oracles" / "rotorpy_openloop.json").read_text())["cases"]


def action_of_rotors(flight: dict) -> torch.Tensor:
    """Thrust and torques of four rotors: lift k_eta w^2 at each place; drag k_m w^2 against its turning.

    `rotor_dir` is the sign of the torque that the body feels about z, so +1 is a rotor turning clockwise from above.
    """
    squared = torch.tensor(flight["rotor_speeds"], dtype=torch.float64).square()
    lift = flight["k_eta"] * squared
    place = torch.tensor(flight["rotor_pos"], dtype=torch.float64)
    yaw = (torch.tensor(flight["rotor_dir"], dtype=torch.float64) * flight["k_m"] * squared).sum()
    return torch.stack([lift.sum(), (place[:, 1] * lift).sum(), (-place[:, 0] * lift).sum(), yaw])


def flown(flight: dict, dt: float) -> RigidState:
    """The state after 0.5 s of constant rotor speeds."""
    robot = Quadrotor(QuadrotorConfig(mass=flight["mass"], inertia=tuple(flight["I"])))
    state = recorded_state(flight["states"][0])
    for _ in range(round(0.5 / dt)):
        state = robot.step(state, action_of_rotors(flight), dt)
    return state


def recorded_state(record: dict) -> RigidState:
    """A recorded state; its quaternion is x, y, z, w."""
    x, y, z, w = record["q"]
    place, velocity, quaternion, rate = (
        torch.tensor(numbers, dtype=torch.float64) for numbers in (record["x"], record["v"], [w, x, y, z], record["w"])
    )
    return RigidState(place, velocity, so3.matrix_from_quaternion(quaternion), rate)


def error(state: RigidState, record: dict) -> torch.Tensor:
    """Distances in position [m], velocity [m/s], attitude [rad] and body rate [rad/s]."""
    return state.local(recorded_state(record)).reshape(4, 3).norm(dim=-1)


@pytest.mark.skipif("NERFNAV_TEST_DATA" not in os.environ, reason="needs recorded flights")
@pytest.mark.parametrize("number", range(8))
def test_small_steps_converge_to_the_recorded_flight(number: int):
    flight = flights()[number]
    recorded = flight["states"][50]
    states = [flown(flight, dt) for dt in (2e-3, 1e-3)]
    extrapolated = states[0].retract(2 * states[0].local(states[1]))
    coarse, fine, best = (error(state, recorded) for state in (*states, extrapolated))
    assert (fine < 0.1).all()
    # explicit Euler: half the step, half the error ...
    counts = coarse > 1e-6
    assert counts.any() or number in (0, 4)  # the first flight of each vehicle hovers: there is no error to halve
    assert (((coarse / fine)[counts] - 2).abs() < 0.1).all()
    # ... and Richardson's extrapolation removes nearly all of it
    assert (best <= 0.05 * fine + 1e-5).all()


@pytest.mark.parametrize("seed", range(12))
def test_what_comes_of_holding_is_that_of_its_steps(seed: int):
    class Plain(Quadrotor):
        """Has no twin of its holding, so that it is done in torch."""

        def compiled_hold(self, start: RigidState, wanted: torch.Tensor, dt: float, rest: float) -> None:
            return None

    draws = torch.Generator().manual_seed(seed)
    noise = torch.tensor([0.0] * 3 + [1.0] * 3 + [0.6] * 3 + [2.0] * 3, dtype=torch.float64)
    level = RigidState.at_rest((0.1, 0.2, 0.5), 0.7).to(torch.float64)
    start = level.retract(noise * torch.randn(12, generator=draws, dtype=torch.float64))
    wanted = torch.zeros(20, 3, dtype=torch.float64)
    wanted[: seed % 5] = torch.randn(3, generator=draws, dtype=torch.float64)
    expected, found = (robot.roll_out_hold(start, wanted, DT, 0.1) for robot in (Plain(), ROBOT))
    assert len(found.actions) == len(expected.actions) < 20
    torch.testing.assert_close(found.actions, expected.actions, rtol=1e-6, atol=1e-6)
    for part in ("position", "velocity", "rotation", "body_rate"):
        ours, theirs = getattr(found.states, part), getattr(expected.states, part)
        torch.testing.assert_close(ours, theirs, rtol=1e-6, atol=1e-6)
    assert found.states.velocity[-1].norm() < 0.1


def test_who_holds_otherwise_is_not_moved_by_the_compiled_twin():
    class Idle(Quadrotor):
        def hold(self, state: RigidState, dt: float, turn: float = 0.0) -> torch.Tensor:
            return torch.zeros(4)

    start = RigidState.at_rest((0.0, 0.0, 0.5))
    fallen = Idle().roll_out_hold(start, torch.ones(5, 3), DT, 0.1).states
    assert fallen.velocity[-1, 2].item() == pytest.approx(-9.81 * 5 * DT, rel=1e-4)
