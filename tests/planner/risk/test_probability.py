"""Collision probability: against the normal distribution, against simulated errors, and at its limits."""

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
import torch
from torch import Tensor

from nerfnav.field import SOLID_DENSITY, Field
from nerfnav.field.core.occupancy import EMPTY_RAW, raw_of
from nerfnav.field.models.voxel import VoxelField
from nerfnav.geometry import so3
from nerfnav.obstacles import BoxShape, ConstantVelocity, Obstacle
from nerfnav.planner import Movers
from nerfnav.planner.risk.probability import ProbabilityConfig, collision_probability, sample_errors
from nerfnav.planner.risk.sampled_flights import _DEPTH, BodyCheck, SampledFlights
from nerfnav.planner.risk.tracking_error import relative_degrees, tracking_deviations
from nerfnav.robots import Motion, NoiseModel, RigidState, Robot, StateNoise
from nerfnav.robots.couch import Couch
from nerfnav.robots.diffdrive import DiffDrive
from tests.planner.halls import Block, Building, field_of
from tests.planner.places import BOX, ROBOT, Fog, Wall, straight_motion

NONE = StateNoise(0.0, 0.0, 0.0, 0.0)
PUSHED = NoiseModel(StateNoise(0.02, 0.0, 0.0, 0.0), NONE)
"""Noise on the position alone, and a state that is known."""
ERROR = 0.04
"""Error to the sides after four steps of that noise [m]."""
FINE = ProbabilityConfig(flights=(4096,), poses_per_step=16)
LAST = 15.5 / 16
"""Share of a step at its last pose."""
CLOSED = Wall(door=0.0)
FACE = 0.05 + 0.1 + 0.01 * math.log(200 / 5 - 1)
"""Distance from the middle of that wall at which the body touches what counts as solid [m]."""
SOLID_RAW, STEP = 0.5, 0.0125
LEVEL_SET = STEP * (SOLID_RAW - raw_of(SOLID_DENSITY)) / (SOLID_RAW - EMPTY_RAW)
"""Distance from the last solid node of a grid at which its density falls below what counts as solid [m]."""


@lru_cache
def slab(edge: float = 0.0, rise: float = 2.0) -> VoxelField:
    """A grid that is solid at all nodes up to x = `edge` and z = `rise` [m], free above: 12.5 mm from node to node."""
    counts = [round(size / STEP) + 1 for size in BOX.size.tolist()]
    values = torch.full((*counts, 4), 0.5)
    values[..., 0] = EMPTY_RAW
    x, z = round((edge + 1) / STEP), round(rise / STEP)
    values[: x + 1, :, : z + 1, 0] = SOLID_RAW
    return VoxelField(BOX, values, torch.ones(3))


def standing(x: float, steps: int, yaw: float = 0.0, z: float = 0.5) -> Motion:
    """A robot that stays where it is."""
    motion = straight_motion((x, 0.0, z), (x, 0.0, z), steps)
    rotation = so3.from_yaw(torch.tensor(yaw)).expand(steps + 1, 3, 3)
    return Motion(replace(motion.states, rotation=rotation), motion.actions, motion.dt)


def within(found: float, expected: float) -> bool:
    """Whether an estimate is within three standard errors."""
    return abs(found - expected) <= 3 * math.sqrt(expected * (1 - expected) / sum(FINE.flights))


def tail(deviations: float) -> float:
    """Probability that a normal number is so many deviations above its mean."""
    return 0.5 * math.erfc(deviations / math.sqrt(2))


def test_errors_have_the_covariance_of_the_tracking_error_from_the_first_step_on():
    noise = NoiseModel()
    errors = sample_errors(ROBOT, 0.1, noise, 12, 8000)
    deviations = tracking_deviations(ROBOT, 0.1, noise)
    for time in range(1, 13):
        expected = deviations[min(time, len(deviations)) - 1]
        assert errors[time].std(0)[:3] == pytest.approx([expected.level, expected.level, expected.height], rel=0.03)
    assert errors[0].std(0)[:3] == pytest.approx(noise.estimate.position_m, rel=0.03)
    assert np.abs(errors.mean(1)).max() < 4 * deviations[-1].level / math.sqrt(8000)


def test_neighbouring_errors_share_the_noise_of_all_steps_but_one():
    degrees = relative_degrees(ROBOT, 0.1)[1][:3].tolist()
    assert degrees == [4, 4, 2]
    errors = sample_errors(ROBOT, 0.1, PUSHED, 12, 8000)
    for axis, degree in enumerate(degrees):
        for lag in range(6):
            found = np.corrcoef(errors[6, :, axis], errors[6 + lag, :, axis])[0, 1]
            assert found == pytest.approx(max(0.0, 1 - lag / degree), abs=0.04)


@pytest.mark.parametrize("distance", [0.02, 0.05, 0.09])
@pytest.mark.parametrize("field", [CLOSED, slab()], ids=["formula", "grid"])
def test_beside_a_wall_one_step_is_the_tail_of_a_normal_distribution(field: Field, distance: float):
    """In a grid the surface is three quarters of the nodes' distance behind the edge of what is dense."""
    face = -FACE if field is CLOSED else LEVEL_SET + 0.05 - _DEPTH * STEP
    away = -distance if field is CLOSED else distance
    found = collision_probability(field, ROBOT, standing(face + away, 1), PUSHED, config=FINE)
    assert within(found, tail(distance / LAST / 0.02))


def test_the_probability_is_that_of_simulated_errors():
    """Random walks of four steps, checked by the distance from the wall alone."""
    draws, steps, distance = np.random.default_rng(1), 20, 0.08
    pushes = 0.02 * draws.standard_normal((steps, 50_000))
    sums = np.cumsum(np.vstack([np.zeros((1, 50_000)), pushes]), 0)
    errors = sums - np.vstack([np.zeros((4, 50_000)), sums])[: steps + 1]
    between = [errors[:-1] + share * np.diff(errors, axis=0) for share in (1 - LAST, LAST)]
    expected = float((np.max(between, (0, 1)) > distance).mean())
    found = collision_probability(
        slab(), ROBOT, standing(LEVEL_SET + 0.05 - _DEPTH * STEP + distance, steps), PUSHED, config=FINE
    )
    assert expected > 0.15 and within(found, expected)
    once = tail(distance / ERROR)
    assert once < found < 0.7 * steps * once, "less than the sum over steps, which counts a deviation again"


@pytest.mark.parametrize("robot", [ROBOT, DiffDrive(), Couch()], ids=["quadrotor", "diffdrive", "couch"])
@pytest.mark.parametrize("tolerance", [0.0, 0.08])
def test_the_kernel_marks_the_same_flights_as_its_twin(robot: Robot, tolerance: float):
    field, motion = slab(rise=0.45), straight_motion((0.35, -0.3, 0.42), (0.12, 0.3, 0.48))
    turned = so3.from_yaw(torch.linspace(0, 1.2, 11)) @ so3.exp(torch.tensor([0.2, 0.1, 0.0]))
    motion = Motion(replace(motion.states, rotation=turned), motion.actions, motion.dt)
    flights = SampledFlights.of(motion, sample_errors(robot, 0.1, NoiseModel(), 10, 400), tolerance, 4)
    check = BodyCheck.of(field, robot.body)
    compiled, twin = check.mark_hits(flights), check.mark_hits_anywhere(flights)
    assert 0 < compiled.sum() < 400
    np.testing.assert_array_equal(compiled, twin)


def test_the_kernel_marks_the_same_flights_in_bricks():
    block = Block((0.0, 0.0, 0.0), (1.0, 2.0, 0.45))
    field = field_of(Building((2.0, 2.0, 1.0), (block,)), 0.02)
    motion = straight_motion((1.3, 0.7, 0.42), (1.1, 1.3, 0.48))
    flights = SampledFlights.of(motion, sample_errors(ROBOT, 0.1, NoiseModel(), 10, 400), 0.0, 4)
    check = BodyCheck.of(field, ROBOT.body)
    compiled = check.mark_hits(flights)
    assert 0 < compiled.sum() < 400
    np.testing.assert_array_equal(compiled, check.mark_hits_anywhere(flights))


def test_without_obstacles_it_is_zero_and_inside_of_one_it_is_one():
    empty, along = Fog(rho=0.0), straight_motion((-0.5, 0.0, 0.5), (0.5, 0.0, 0.5))
    assert collision_probability(empty, ROBOT, along) == 0
    assert collision_probability(slab(-1.0), ROBOT, along) == 0
    assert collision_probability(CLOSED, ROBOT, standing(0.0, 4)) == 1
    assert collision_probability(slab(0.5), ROBOT, standing(-0.5, 4)) == 1
    assert collision_probability(CLOSED, ROBOT, along) == 1


def test_movers_count_where_they_are_when_the_robot_is_there():
    empty, along = Fog(rho=0.0), straight_motion((-0.5, 0.0, 0.5), (0.5, 0.0, 0.5))
    reach = 0.1 + max(ROBOT.body.extents)

    def crossing(aside: float, time: float = 0.0) -> float:
        """Chance with a box that is `aside` of the middle of the way at 0.5 s, and leaves it at 1 m/s."""
        motion = ConstantVelocity((0.0, 1.0, 0.0))
        box = Obstacle("box", BoxShape((0.2, 0.2, 0.2)), (0.0, aside - 0.5, 0.5), motion=motion)
        return collision_probability(empty, ROBOT, along, movers=Movers((box,)), time=time)

    assert crossing(0.0) == 1 and crossing(0.0, time=3.0) == 0
    assert crossing(0.0, time=0.5) < 1 and crossing(4.0) == 0
    chances = [crossing(reach + distance) for distance in (0.0, 0.05, 0.1, 0.4)]
    assert chances == sorted(chances, reverse=True) and 0 < chances[1] < 1 and chances[-1] == 0


def test_a_cart_in_a_corridor_is_at_risk_on_both_sides_and_not_by_its_height():
    corridor, cart = Wall(door=0.3, thickness=2.0), DiffDrive()
    along = straight_motion((-0.6, 0.5, 0.4), (0.6, 0.5, 0.4))
    aside = straight_motion((-0.6, 0.53, 0.4), (0.6, 0.53, 0.4))
    amid, off = (collision_probability(corridor, cart, motion) for motion in (along, aside))
    assert 0.05 < amid < off < 1
    assert (sample_errors(cart, 0.1, NoiseModel(), 10, 100)[..., 2] == 0).all()


def test_a_long_body_is_checked_with_its_heading():
    corridor, couch = Wall(door=0.3, thickness=2.0), Couch()
    ahead, across = (
        collision_probability(corridor, couch, _at(standing(0.0, 3, yaw), 0.5)) for yaw in (0.0, 0.5 * math.pi)
    )
    assert ahead < 0.3 and across > 0.9


def _at(motion: Motion, y: float) -> Motion:
    shift = torch.tensor([0.0, y, 0.0])
    return Motion(replace(motion.states, position=motion.states.position + shift), motion.actions, motion.dt)


def test_a_flight_that_has_arrived_touches_nothing_any_more():
    """It approaches the wall at last, and comes near its goal before."""
    motion = straight_motion((-0.6, 0.0, 0.5), (-FACE - 0.03, 0.0, 0.5))
    all_of_it, until_near = (collision_probability(CLOSED, ROBOT, motion, tolerance=at) for at in (0.0, 0.08))
    assert until_near < 0.6 * all_of_it


def test_it_grows_with_noise_and_shorter_steps_of_the_same_noise_need_more_of_them():
    motion = standing(-FACE - 0.06, 10)
    calm, rough = (
        collision_probability(CLOSED, ROBOT, motion, NoiseModel(StateNoise(size, 0.0, 0.0, 0.0), NONE))
        for size in (0.01, 0.03)
    )
    assert calm < 0.05 < 0.3 < rough
    assert collision_probability(CLOSED, ROBOT, motion, NoiseModel(NONE, NONE)) == 0
    halved = Motion(motion.states, motion.actions, 0.05)
    assert 0 < collision_probability(CLOSED, ROBOT, halved) < 1


def test_it_is_the_same_each_time_and_unlikely_collisions_are_resolved():
    motion, config = standing(LEVEL_SET + 0.05 + 0.12, 10), ProbabilityConfig()
    (first,) = {collision_probability(slab(), ROBOT, motion, PUSHED) for _ in range(2)}
    others = [
        collision_probability(slab(), ROBOT, motion, PUSHED, config=replace(config, seed=100 * turn))
        for turn in range(1, 9)
    ]
    assert 0.0005 < first < 0.01
    mean = float(np.mean(others))
    assert np.std(others) < 1.6 * math.sqrt(mean / sum(config.flights))


def test_a_plan_that_is_not_finite_counts_as_certain_to_collide():
    motion = standing(-0.6, 3)
    wrong: Tensor = motion.states.position.clone()
    wrong[1, 0] = math.nan
    states: RigidState = replace(motion.states, position=wrong)
    assert collision_probability(CLOSED, ROBOT, Motion(states, motion.actions, motion.dt)) == 1
