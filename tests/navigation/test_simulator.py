"""The simulated robot."""

from dataclasses import replace

import pytest
import torch

from nerfnav import robots
from nerfnav.core.errors import InvalidNumberError
from nerfnav.geometry.box import Box
from nerfnav.geometry.camera import R_BODY_CAMERA, Pose
from nerfnav.navigation.simulator import world_generator
from nerfnav.obstacles import BoxShape, ConstantVelocity, Obstacle
from nerfnav.planner import Movers
from nerfnav.robots import StateNoise
from nerfnav.robots.state import RigidState
from tests.navigation.doubles import ROBOT, START, draws, grey, simulator

HOVER = torch.tensor([ROBOT.weight, 0.0, 0.0, 0.0])


def test_without_noise_the_truth_follows_the_dynamics():
    world = simulator(noise=None)
    action = HOVER + torch.tensor([0.5, 1e-3, 0.0, 0.0])
    world.act(action, 0.1)
    torch.testing.assert_close(world.state.velocity, ROBOT.step(START, action, 0.1).velocity)


def test_the_noise_disturbs_the_truth_as_much_as_it_says():
    noise, errors = StateNoise(), []
    for seed in range(400):
        world = simulator(noise=noise, generator=draws(seed))
        world.act(HOVER, 0.1)
        errors.append(ROBOT.step(START, HOVER, 0.1).local(world.state))
    torch.testing.assert_close(torch.stack(errors).std(0), noise.std(), rtol=0.15, atol=0)


def test_movers_touch_the_robot_at_the_time_of_the_flight_and_the_camera_shows_that_time():
    motion = ConstantVelocity((0.0, 1.0, 0.0))
    movers = Movers((Obstacle("box", BoxShape((0.1, 0.1, 0.1)), (-0.4, -0.35, 0.3), motion=motion),))
    times = list[float]()

    def look(pose: Pose, time: float) -> torch.Tensor:
        times.append(time)
        return grey(pose)

    world = simulator(noise=None, movers=movers, camera_at=look)
    touched = [world.act(HOVER, 0.1) for _ in range(8)]
    world.look()
    assert touched == [False, False, True, True, True, False, False, False]
    assert times == [pytest.approx(0.8)] and world.time == pytest.approx(0.8)
    assert not any(simulator(noise=None).act(HOVER, 0.1) for _ in range(3))


def test_the_same_seed_gives_the_same_world():
    first, second = simulator(generator=draws(4)), simulator(generator=draws(4))
    for _ in range(3):
        first.act(HOVER, 0.1)
        second.act(HOVER, 0.1)
    assert torch.equal(first.state.position, second.state.position)


@pytest.mark.parametrize("seed", [-1, 2**32, 10**30])
def test_a_seed_that_generators_do_not_take_is_refused(seed: int) -> None:
    with pytest.raises(InvalidNumberError, match="seed must be from 0 to 4294967295, not"):
        world_generator(seed)


def test_the_camera_is_asked_for_the_picture_at_its_mount():
    asked: list[Pose] = []

    def camera(pose: Pose) -> torch.Tensor:
        asked.append(pose)
        return grey(pose)

    mount = Pose(R_BODY_CAMERA, torch.tensor([0.1, 0.0, 0.02]))
    state = RigidState.at_rest((1.0, 2.0, 3.0), torch.pi / 2)
    world = simulator(camera=camera, mount=mount)
    world.state = state
    assert world.look().shape == (4, 6, 3)
    torch.testing.assert_close(asked[0].position, torch.tensor([1.0, 2.1, 3.02]))
    looking = asked[0].rotation @ torch.tensor([0.0, 0.0, -1.0])
    torch.testing.assert_close(looking, torch.tensor([0.0, 1.0, 0.0]), atol=1e-6, rtol=0)


def test_contact_is_reported_and_the_robot_flies_on():
    def contact(before: RigidState, after: RigidState) -> bool:
        return bool(after.velocity[2] > before.velocity[2])

    world = simulator(noise=None, contact=contact)
    assert world.act(1.2 * HOVER, 0.1)
    assert not world.act(0.8 * HOVER, 0.1)
    assert world.state.position[2] > START.position[2]


def test_a_body_is_outside_once_it_has_left_the_box_and_nowhere_without_one():
    world, radius = simulator(box=Box.of((-1.0, -1.0, 0.0), (1.0, 1.0, 1.0))), simulator().robot.body.radius
    there, leaving = (RigidState.at_rest((0.0, 0.0, 1.0 + share * radius)) for share in (1.1, 0.9))
    assert world.is_outside(there) and not world.is_outside(leaving) and not world.is_outside(START)
    assert not simulator().is_outside(there)


def test_nothing_is_touched_without_ground_truth():
    assert not simulator().act(HOVER, 0.1)


@pytest.mark.parametrize("name", ["couch", "diffdrive"])
def test_noise_does_not_lift_a_robot_off_the_ground(name: str):
    world = replace(simulator(generator=draws(1)), robot=robots.load(name), state=RigidState.at_rest((0.0, 0.0, 0.1)))
    for _ in range(3):
        world.act(torch.zeros(len(world.robot.action_names)), 0.1)
    world.robot.check_ends(world.state, RigidState.at_rest((1.0, 0.0, 0.1)))
    assert world.state.position[:2].norm() > 1e-4
